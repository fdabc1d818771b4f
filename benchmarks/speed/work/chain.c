/* A chain of N bodies on springs with Coulomb friction, by Runge-Kutta 4: plain C as the yardstick of the simulator.
 *
 *   J_i dw_i/dt = T_(i-1,i) - T_(i,i+1) - B_i w_i - F_i sign(w_i)      T = k (x_i - x_(i+1)) + c (w_i - w_(i+1))
 *
 * A body that comes to rest within a step has the step cut there; it sticks while less than its friction pulls at it.
 * gcc -O3 -DN=1 -shared -fPIC chain.c
 */
#include <math.h>

typedef struct {
  double inertia[N], viscous[N], dry[N], stiffness[N], damping[N], gain;
} chain;

static void accelerations(const chain *m, double command, const double *x, const double *w, const double *mode,
                          double *a) {
  double before = m->gain * command;
  for (int i = 0; i < N; i++) {
    double after = 0.0;
    if (i + 1 < N) after = m->stiffness[i] * (x[i] - x[i + 1]) + m->damping[i] * (w[i] - w[i + 1]);
    a[i] = (before - after - m->viscous[i] * w[i] - m->dry[i] * mode[i]) / m->inertia[i];
    before = after;
  }
}

/* Direction in which each body slides: that of its speed, or of what pulls at it; a sticking body gets none. */
static void choose(const chain *m, double command, const double *x, const double *w, double *mode, int *stuck) {
  double none[N] = {0.0}, pull[N];
  int resting = 0;
  for (int i = 0; i < N; i++) resting |= m->dry[i] > 0.0 && w[i] == 0.0;
  if (resting) accelerations(m, command, x, w, none, pull);
  for (int i = 0; i < N; i++) {
    stuck[i] = 0;
    mode[i] = w[i] > 0.0 ? 1.0 : -1.0;
    if (m->dry[i] > 0.0 && w[i] == 0.0) {
      double force = pull[i] * m->inertia[i];
      stuck[i] = fabs(force) <= m->dry[i];
      mode[i] = stuck[i] ? 0.0 : force > 0.0 ? 1.0 : -1.0;
    }
  }
}

static void rate(const chain *m, double command, const double *x, const double *w, const double *mode, const int *stuck,
                 double *a) {
  accelerations(m, command, x, w, mode, a);
  for (int i = 0; i < N; i++)
    if (stuck[i]) a[i] = 0.0;
}

static void runge_kutta(const chain *m, double command, double h, const double *x, const double *w, const double *mode,
                        const int *stuck, double *x1, double *w1) {
  double a[4][N], v[4][N], at[N];
  rate(m, command, x, w, mode, stuck, a[0]);
  for (int i = 0; i < N; i++) v[0][i] = w[i];
  for (int s = 1; s < 4; s++) {
    double part = s < 3 ? 0.5 * h : h;
    for (int i = 0; i < N; i++) {
      at[i] = x[i] + part * v[s - 1][i];
      v[s][i] = w[i] + part * a[s - 1][i];
    }
    rate(m, command, at, v[s], mode, stuck, a[s]);
  }
  for (int i = 0; i < N; i++) {
    x1[i] = x[i] + h / 6.0 * (v[0][i] + 2.0 * (v[1][i] + v[2][i]) + v[3][i]);
    w1[i] = w[i] + h / 6.0 * (a[0][i] + 2.0 * (a[1][i] + a[2][i]) + a[3][i]);
  }
}

/* Free run from rest: positions and speeds at each sample, before its command acts. */
void simulate(const chain *m, const double *command, int samples, double period, int pieces, double *output) {
  double x[N] = {0.0}, w[N] = {0.0}, x1[N], w1[N], mode[N];
  int stuck[N];
  for (int k = 0; k < samples; k++) {
    for (int i = 0; i < N; i++) {
      output[2 * N * k + i] = x[i];
      output[2 * N * k + N + i] = w[i];
    }
    for (int piece = 0; piece < pieces; piece++) {
      double left = period / pieces;
      for (int events = 0; left > 0.0; events++) {
        double h = left;
        int stopped = -1;
        choose(m, command[k], x, w, mode, stuck);
        runge_kutta(m, command[k], h, x, w, mode, stuck, x1, w1);
        if (events < 20) {
          for (int i = 0; i < N; i++)
            if (m->dry[i] > 0.0 && w1[i] * mode[i] < 0.0) {
              double guess = left * w[i] / (w[i] - w1[i]);
              if (guess < h) h = guess, stopped = i;
            }
          for (int turn = 0; stopped >= 0 && turn < 3; turn++) { /* secant for the instant of rest */
            runge_kutta(m, command[k], h, x, w, mode, stuck, x1, w1);
            double slope = (w1[stopped] - w[stopped]) / h;
            double better = h - w1[stopped] / slope;
            if (!(better > 0.0 && better < left)) break;
            h = better;
          }
          if (stopped >= 0) runge_kutta(m, command[k], h, x, w, mode, stuck, x1, w1);
        }
        for (int i = 0; i < N; i++) {
          x[i] = x1[i];
          w[i] = w1[i];
        }
        if (stopped >= 0) w[stopped] = 0.0;
        left -= h;
        if (left < 1e-15) break;
      }
    }
  }
}
