"""The extended Kalman filter that estimates the state and the coefficients together."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from idloop.errors import InputError
from idloop.estimation.polynomial.polynomials import Orders, Polynomials
from idloop.estimation.recursive.estimator import NEVER, RecursivePolynomial
from idloop.estimation.recursive.step import (
    COUNT,
    PROJECTED,
    SCALARS,
    VARIANCE,
    WEIGHT,
    limit_variances,
    measurement_update,
    stable,
    time_update,
    variances,
)

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
# Mean of the squared innovations over the variances that the filter gives them: 1 where its noises are right.
# And the sum of the logarithms of those variances, which with it makes a likelihood.
FIT, LOGARITHMS, JOINT_SCALARS = SCALARS, SCALARS + 1, SCALARS + 2
# Standard deviations of a state, outputs being of size 1: at a start, and the most that a gap may leave.
STATE, LOST = 10.0, 100.0
_RUN_AWAY = 1e8
_HALVINGS = 6
# Noise relative to the size of the output: before the first samples have been used, and the least that is assumed. With
# less at first the filter may diverge: its linearization does not hold yet.
_DEFAULT_NOISE, _LEAST = 1.0, 1e-4
# Samples after which the random walk of a coefficient adds as much variance as the data have removed.
_MEMORY = 1e5
# Times its standard error by which the start from the first samples may be wrong: they are processed once more.
_START_ERROR = 10.0
# Shares of the noise that may be in the equation, the rest in the sensor: the likeliest is used.
_SHARES = (0.0, 0.03, 0.1, 0.3, 0.6, 0.9, 1.0)
_FIRST = 400  # most samples from which the noise levels are estimated


class Start(NamedTuple):
    """Values in the units of the signals."""

    # Shape (k,): coefficients of A and B, and standard errors
    vector: Array
    stderr: Array
    # Variance of the equation error and of the measurement noise, if all noise were that [output unit squared]
    process: float
    measurement: float


def start_from(inputs: Array, outputs: Array, orders: Orders) -> Start | None:
    """Fit an ARMAX model by two least squares, and take the variance of A y - B u from it.

    A long ARX model gives the innovations, which are regressors of the second fit (Hannan and Rissanen,
    Biometrika 69, 1982). White noise on the measurement passes through A, white noise in the equation does not.

    `inputs`, `outputs` (n, m), (n,): NaN where nothing was measured; `orders`: of A and B. Returns: none where there
    are too few samples.
    """
    size = max(orders.na, *orders.nb, 1)
    held = [_held(inputs[:, i]) for i in range(orders.inputs)]
    scale = np.array([_size(one) for one in (*held, outputs)])
    y, u = outputs / scale[-1], [one / by for one, by in zip(held, scale, strict=False)]
    # So many lags that what is left is white, and few enough for the samples.
    count = min(max(2 * size + 2, len(y) // (6 * (orders.inputs + 1))), 10 * size)
    lags = range(1, count + 1)
    long = [_late(y, k) for k in lags] + [_late(u[i], nk + k) for i, nk in enumerate(orders.nk) for k in range(count)]
    fitted = _least_squares(np.column_stack(long), y)
    if fitted is None:
        return None
    errors = fitted[1]
    short = [-_late(y, k) for k in range(1, orders.na + 1)]
    short += [_late(u[i], nk + k) for i, nk in enumerate(orders.nk) for k in range(orders.nb[i])]
    short += [_late(errors, k) for k in range(1, size + 1)]
    fitted = _least_squares(np.column_stack(short), y)
    if fitted is None:
        return None
    vector, left, stderr = fitted
    known = np.isfinite(left)
    a, c = (np.zeros(size + 1) for _ in range(2))
    a[0] = c[0] = 1.0
    a[1 : orders.na + 1], c[1:] = vector[: orders.na], vector[orders.size :]
    process = float(np.mean(left[known] ** 2) * (c @ c))
    measurement = process / float(a @ a)
    unit = np.ones(orders.size)
    for i in range(orders.inputs):
        unit[orders.b(i)] = scale[-1] / scale[i]
    free = orders.size
    return Start(vector[:free] * unit, stderr[:free] * unit, process * scale[-1] ** 2, measurement * scale[-1] ** 2)


def _held(signal: Array) -> Array:
    """The signal with the value before in the place of each that is missing, 0 before the first."""
    known = np.isfinite(signal)
    last = np.maximum.accumulate(np.where(known, np.arange(len(signal)), -1))
    return np.where(last >= 0, np.where(known, signal, 0.0)[last], 0.0)


def _size(signal: Array) -> float:
    known = signal[np.isfinite(signal)]
    size = float(np.sqrt(np.mean(known**2))) if np.any(known) else 0.0
    return size if size > 0.0 else 1.0


def _late(signal: Array, lag: int) -> Array:
    return np.concatenate([np.full(min(lag, len(signal)), np.nan), signal[: max(len(signal) - lag, 0)]])


def _least_squares(rows: Array, y: Array) -> tuple[Array, Array, Array] | None:
    """Solution, errors of every sample (NaN where unknown) and standard errors."""
    known = np.isfinite(y) & np.all(np.isfinite(rows), axis=1)
    spare = int(np.sum(known)) - rows.shape[1]
    if spare < rows.shape[1] // 2 + 5:
        return None
    solution = np.linalg.lstsq(rows[known], y[known], rcond=None)[0]
    errors = np.where(known, y - np.where(np.isfinite(rows), rows, 0.0) @ solution, np.nan)
    variance = float(np.sum(errors[known] ** 2)) / spare
    stderr = np.sqrt(variance * np.maximum(np.diag(np.linalg.pinv(rows[known].T @ rows[known])), 0.0))
    # The coefficients of a command that has not moved yet are unknown, though the pseudo-inverse gives 0.
    stderr[np.all(rows[known] == 0.0, axis=0)] = np.inf
    return solution, errors, stderr


@njit(cache=True, nogil=True)
def restart(state: Array, upper: Array, diagonal: Array) -> None:
    """Know nothing of the state any more; the covariance of the coefficients stays."""
    size = len(state)
    state[:] = 0.0
    # The coefficients come last, so that their block of U D U^T is theirs alone.
    upper[:size, :] = 0.0
    for k in range(size):
        upper[k, k] = 1.0
        diagonal[k] = STATE * STATE


@njit(cache=True, nogil=True)
def joint_advance(
    na: int, nb: Whole, nk: Whole, state: Array, theta: Array, upper: Array, diagonal: Array, past: Array,
    scalars: Array, inputs: Array, outputs: Array, noise: Array, measurement: float, forgetting: float, most: Array,
    radius: float, innovations: Array, values: Array, errors: Array, every: int, offset: int,
) -> None:  # fmt: skip
    """Run the filter over some samples; everything that it remembers is changed in place.

    `nb`, `nk` (m,): orders; `state` (s,): of the observer canonical form after the last sample; the output is its first
    component; `theta` (k,): coefficients, A's before B's; `upper`, `diagonal` (s + k, s + k), (s + k,): covariance of
    the state and the coefficients; `past` (m, lags): commands, the newest first; `scalars` (9,); `inputs`, `outputs`
    (n, m), (n,): an output of NaN is predicted and updates nothing; an input of NaN is the one before; `noise` (s +
    k,): variances that the states and the coefficients gain in one sample; `measurement`: variance of the measurement
    noise, above 0; `forgetting`: weight of a sample over that of the next, for the coefficients; `most` (s + k,):
    variances that are not exceeded; `radius`: within which the roots of A are kept; `innovations` (n,): receives y less
    its prediction; `values`, `errors` ((offset + n) // every, k): receive the coefficients and their variances, every
    so many samples; `every`, `offset`: period of the rows, and samples since the last of them.
    """
    size, states, m = len(diagonal), len(state), len(nb)
    moved, work = np.zeros((size, size)), np.zeros((size, size + 1))
    gain, variance, ahead = np.zeros(size), np.zeros(size), np.zeros(states)
    direction, old = np.zeros(size), np.zeros(len(theta))
    direction[0] = 1.0
    narrower = np.sqrt(forgetting)
    for t in range(len(outputs)):
        for i in range(m):
            value = inputs[t, i]
            if np.isnan(value):
                value = past[i, 0]
            for k in range(past.shape[1] - 1, 0, -1):
                past[i, k] = past[i, k - 1]
            past[i, 0] = value
        # To the instant of this sample: the step is bilinear, `moved` is its derivative times U.
        first = state[0]
        for k in range(states):
            ahead[k] = state[k + 1] if k + 1 < states else 0.0
            if k < na:
                ahead[k] -= theta[k] * first
            for j in range(size):
                moved[k, j] = upper[k + 1, j] if k + 1 < states else 0.0
                if k < na:
                    moved[k, j] -= theta[k] * upper[0, j] + first * upper[states + k, j]
            place = na + k
            for i in range(m):
                if k < nb[i]:
                    command = past[i, nk[i]]
                    ahead[k] += theta[place] * command
                    for j in range(size):
                        moved[k, j] += command * upper[states + place, j]
                place += nb[i]
        for k in range(states, size):
            for j in range(size):
                moved[k, j] = upper[k, j]
        for k in range(states):
            state[k] = ahead[k]
        time_update(upper, diagonal, moved, noise, work)
        variances(upper, diagonal, variance)
        limit_variances(upper, diagonal, variance, most)
        if not np.max(np.abs(state)) < _RUN_AWAY:
            restart(state, upper, diagonal)
            scalars[PROJECTED] += 1.0
        error = outputs[t] - state[0]
        innovations[t] = error
        if np.isfinite(error):
            total = measurement_update(upper, diagonal, direction, measurement, gain)
            scalars[COUNT] += 1.0
            scalars[WEIGHT] = forgetting * scalars[WEIGHT] + 1.0
            scalars[FIT] += (error * error / total - scalars[FIT]) / scalars[WEIGHT]
            scalars[LOGARITHMS] += np.log(total)
            scalars[VARIANCE] = scalars[FIT] * total
            for k in range(states):
                state[k] += gain[k] * error
            for k in range(len(theta)):
                old[k] = theta[k]
            step = 1.0
            for halving in range(_HALVINGS + 1):
                for k in range(len(theta)):
                    theta[k] = old[k] + step * error * gain[states + k]
                if stable(theta[:na], radius):
                    break
                if halving == 0:
                    scalars[PROJECTED] += 1.0
                step = 0.0 if halving == _HALVINGS - 1 else 0.5 * step
            if forgetting < 1.0:
                # Coefficients only: of the state the process noise forgets.
                for k in range(states, size):
                    diagonal[k] /= forgetting
                    for j in range(states):
                        upper[j, k] *= narrower
        if (offset + t + 1) % every == 0:
            variances(upper, diagonal, variance)
            row = (offset + t) // every
            for k in range(len(theta)):
                values[row, k] = theta[k]
                errors[row, k] = variance[states + k] * scalars[FIT]


class ExtendedKalman(RecursivePolynomial):
    """Estimate the state and the coefficients of a model in observer canonical form together, sample by sample.

    The model is, for k = 1 ... s, with s the larger of na and nb, and coefficients that walk slowly at random,

        x_k(t) = -a_k x_1(t-1) + x_(k+1)(t-1) + sum_i b_ik u_i(t - nk_i) + w_k(t),    y(t) = x_1(t) + v(t).

    Ljung (1979) shows what becomes of this filter when the coefficients are constant: it follows a differential
    equation whose rest points are the true coefficients only where the covariances of w and v are those of the
    data. Where they are wrong the estimates are biased, and may diverge, because the filter ignores
    that its gain depends on the coefficients. `recursive_prediction_error` estimates the gain too and has no such bias.
    Without process noise the gain goes to 0, and with it that cause of bias. Standard errors leave the bias out.

    The covariance is kept as U D U^T, so that it stays positive; a sample costs O((s + k)^3) operations.

    Parameters
    ----------
    orders : Orders
        na, nb and nk; the others must be 0.
    process_noise : float or array, shape (s,), optional
        Standard deviation of w [output unit]; a number is that of w_1, the equation error of ARX models. By default
        that under which the first samples are likeliest, and so for `measurement_noise`.
    measurement_noise : float, optional
        Standard deviation of v [output unit], above 0.
    random_walk : float or array, shape (k,), optional
        Standard deviation by which each coefficient moves in one sample [unit of the coefficient].
    drift : float, optional
        The same for all coefficients at once, when every signal is measured in its typical size. By default, without
        `random_walk`, the noise of the output over 1e5: what is older than so many samples counts little.
    forgetting : float
        Weight of a sample over that of the next for the coefficients, in (0, 1].
    start : Polynomials or array, shape (k,), optional
        First coefficients of A and B; otherwise those of least squares on the first samples, which are gone over
        once more.
    prior : float
        Standard deviation of the first coefficients, when every signal is measured in its typical size.
    radius : float
        Circle that the poles are kept in; above 1, so that an integrator is followed.
    **options
        Scales, names and the period, as of `RecursivePolynomial`.

    Raises
    ------
    InputError
        Numbers out of range, or a structure with C, D or F.

    References
    ----------
    L. Ljung, "Asymptotic behavior of the extended Kalman filter as a parameter estimator for linear systems", IEEE
    Transactions on Automatic Control 24, 1979, pages 36 to 50.
    """

    def __init__(
        self,
        orders: Orders,
        *,
        process_noise: ArrayLike | None = None,
        measurement_noise: float | None = None,
        random_walk: ArrayLike | None = None,
        drift: float | None = None,
        forgetting: float = 1.0,
        start: Polynomials | ArrayLike | None = None,
        prior: float = 3.0,
        radius: float = 1.01,
        **options: Any,
    ) -> None:
        if orders.nc or orders.nd or any(orders.nf):
            raise InputError("an extended Kalman filter has polynomials A and B only; give na, nb and nk")
        if not 0.0 < radius < 2.0:
            raise InputError(f"radius = {radius:g}; it must be in (0, 2)")
        if measurement_noise is not None and not (np.isfinite(measurement_noise) and measurement_noise > 0.0):
            raise InputError(f"measurement_noise = {measurement_noise:g}; it must be above 0")
        self._states = max(orders.na, *orders.nb, 1)
        self._process = None if process_noise is None else self._of_states(process_noise)
        self._measurement = measurement_noise
        self._walks = random_walk is not None or drift is not None
        self._prior = float(prior)
        self._noise_levels: tuple[float, float] | None = None
        self._start_error: Array | None = None
        if isinstance(start, Polynomials):
            self._same(start, orders)
            start = start.vector[: orders.size]
        self._started = start is not None
        super().__init__(
            orders, random_walk=random_walk, drift=0.0 if drift is None else drift, forgetting=forgetting, start=start,
            prior=prior, warm_up=0.0, **options,
        )  # fmt: skip
        self._radius = float(radius)
        known = self._started and self._process is not None and measurement_noise is not None
        if not known or len(self._first_samples):
            self._first_samples = np.zeros((min(40 * orders.size + 80, _FIRST) + max(orders.nk), orders.inputs + 1))

    def _of_states(self, deviation: ArrayLike) -> Array:
        given = np.asarray(deviation, dtype=float)
        if given.shape not in {(), (self._states,)} or not (np.all(np.isfinite(given)) and np.all(given >= 0.0)):
            raise InputError(f"process_noise must be 0 or more, one number or {self._states}, one per state")
        return np.concatenate([given.reshape(1), np.zeros(self._states - 1)]) if given.ndim == 0 else given

    @staticmethod
    def _same(start: Polynomials, orders: Orders) -> None:
        own = start.orders
        if (own.na, own.nb, own.nk) != (orders.na, orders.nb, orders.nk):
            raise InputError(f"start has the orders {own}, the estimator {orders}; give the same")

    def _begin(self, input_scale: Array, output_scale: float) -> None:
        super()._begin(input_scale, output_scale)
        k, s = self.orders.size, self._states
        found = self._noise_levels or ((_DEFAULT_NOISE * output_scale) ** 2, 0.0)
        process = np.zeros(s)
        process[0] = found[0]
        if self._process is not None:
            process = self._process**2
        measurement = found[1] if self._measurement is None else self._measurement**2
        self._noise = np.zeros(s + k)
        self._noise[:s] = process / output_scale**2
        # Without sensor noise the filter would be overconfident: a sensor resolves about this much at best.
        floor = _LEAST**2 if self._measurement is None else 0.0
        self._measured = max(measurement / output_scale**2, floor)
        total = float(np.sum(self._noise[:s])) + self._measured
        self._noise[s:] = self._steps if self._walks else total / _MEMORY**2
        self._most = np.concatenate([np.full(s, LOST**2), np.full(k, self._prior**2)])
        self._state = np.zeros(s)
        self._upper, self._diagonal = np.eye(s + k), self._most.copy()
        if self._start_error is not None:
            self._diagonal[s:] = np.clip((self._start_error / self._unit) ** 2, _LEAST**2, self._prior**2)
        restart(self._state, self._upper, self._diagonal)
        self._scalars = np.zeros(JOINT_SCALARS)
        self._commands = np.zeros((self.orders.inputs, max(self.orders.nk) + 1))

    # -- results ---------------------------------------------------------------------

    @property
    def state(self) -> Array:
        """State after the last sample [output unit], shape (s,)."""
        return np.asarray(self._state * self._output_scale)

    @property
    def process_noise(self) -> Array:
        """Standard deviation of w that is assumed [output unit], shape (s,)."""
        return np.asarray(np.sqrt(self._noise[: self._states]) * self._output_scale)

    @property
    def measurement_noise(self) -> float:
        """Standard deviation of v that is assumed [output unit]."""
        return float(np.sqrt(self._measured)) * self._output_scale

    @property
    def covariance(self) -> Array:
        """Covariance of the coefficients, shape (k, k), times the level of noise that the innovations show."""
        upper, diagonal = (one[self._states :] for one in (self._upper[:, self._states :], self._diagonal))
        fit = self._scalars[FIT] if self.samples else 1.0
        return np.asarray(fit * ((upper * diagonal) @ upper.T) * np.outer(self._unit, self._unit))

    @property
    def polynomials(self) -> Polynomials:
        """The present model with the filter's stationary gain: C holds the gain added to A, and errs as A does."""
        orders, s = self.orders, self._states
        vector, own = self.coefficients, self.covariance
        tail = np.zeros(s)
        tail[: orders.na] = vector[: orders.na]
        c = tail + stationary_gain(tail, self._noise[:s], self._measured)
        also = np.zeros((orders.size + s, orders.size))
        also[: orders.size] = np.eye(orders.size)
        also[orders.size : orders.size + orders.na, : orders.na] = np.eye(orders.na)
        whole = Orders(orders.na, orders.nb, s, 0, orders.nf, orders.nk)
        return Polynomials.from_vector(
            whole, np.concatenate([vector, c]), sample_time=self.sample_time, input_names=self.input_names,
            output_name=self.output_name, variance=self.innovation_variance, covariance=also @ own @ also.T,
        )  # fmt: skip

    # -- updates ---------------------------------------------------------------------

    def forget_signals(self) -> None:
        """Begin another experiment: commands before it count as 0, the state is unknown, the coefficients stay."""
        super().forget_signals()
        self._commands[:] = 0.0
        restart(self._state, self._upper, self._diagonal)

    # -- inside -----------------------------------------------------------------------

    def _run(self, inputs: Array, outputs: Array, values: Array, variances: Array, every: int, offset: int) -> Array:
        innovations = np.empty(len(outputs))
        na, (nb, nk) = self.orders.na, (self._numbers[3], self._numbers[5])
        joint_advance(
            na, nb, nk, self._state, self._theta, self._upper, self._diagonal, self._commands, self._scalars,
            np.ascontiguousarray(inputs / self._input_scale), outputs / self._output_scale, self._noise,
            self._measured, self.forgetting, self._most, self._radius, innovations, values, variances, every, offset,
        )  # fmt: skip
        values *= self._unit
        variances *= self._unit**2
        return np.asarray(innovations * self._output_scale)

    def _admit(self, index: int, size: float) -> None:
        super()._admit(index, size)
        if self._walks:
            self._noise[self._states :] = self._steps

    def _rescale(self) -> None:
        samples = self._first_samples[: self._held]
        found = start_from(samples[:, :-1], samples[:, -1], self.orders)
        if found is not None and not self._started:
            self._start, self._start_error = found.vector, _START_ERROR * found.stderr
            poles = self._start[self.orders.a]
            while not stable(np.ascontiguousarray(poles), 0.999 * self._radius):
                # From outside the circle no step would lead in.
                poles *= 0.99 ** np.arange(1, self.orders.na + 1)
        super()._rescale()
        if found is None or (self._process is not None and self._measurement is not None):
            return
        scores = [self._score(samples, share * found.process, (1.0 - share) * found.measurement) for share in _SHARES]
        _, fit, noises = min(scores)
        if self._process is None and self._measurement is None:
            noises = (fit * noises[0], fit * noises[1])
        self._score(samples, *noises)

    def _score(self, samples: Array, process: float, measurement: float) -> tuple[float, float, tuple[float, float]]:
        """Go over the first samples with these variances: how unlikely they are, up to the size of the noise."""
        self._noise_levels = (process, measurement)
        self._begin(self._input_scale, self._output_scale)
        nothing = np.empty((0, self.orders.size))
        self._run(samples[:, :-1], samples[:, -1], nothing, nothing, NEVER, 0)
        fit = float(self._scalars[FIT])
        unlikely = np.log(max(fit, 1e-300)) + self._scalars[LOGARITHMS] / max(self.samples, 1)
        return float(unlikely), fit, self._noise_levels


def stationary_gain(a: Array, noise: Array, measurement: float) -> Array:
    """Gain of the stationary one-step predictor of the state, shape (s,), by running its Riccati equation.

    `a` (s,): tail of A, with zeros up to the number of states; `noise` (s,): variances of the process noise;
    `measurement`: variance of the measurement noise, above 0.
    """
    size = len(a)
    forward = np.eye(size, k=1)
    forward[:, 0] -= a
    spread = np.eye(size) * (measurement + np.max(noise))
    gain = np.zeros(size)
    for _ in range(5000):
        before = gain
        total = spread[0, 0] + measurement
        gain = forward @ spread[:, 0] / total
        spread = forward @ spread @ forward.T - total * np.outer(gain, gain)
        spread = 0.5 * (spread + spread.T) + np.diag(noise)
        if np.max(np.abs(gain - before)) < 1e-10:
            break
    return gain
