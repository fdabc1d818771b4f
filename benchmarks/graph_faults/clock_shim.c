/* The wall clock of the processes that preload this, moved by the nanoseconds that a file holds.
 *
 * The steady clock is left alone, as it is when an administrator or NTP sets the clock. A wait until a time of the wall
 * clock is told to the system in the system's time; any time of day after 2001 is taken for one.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>

static volatile int64_t *offset;
static int (*real)(clockid_t, struct timespec *);

__attribute__((constructor)) static void open_offset(void) {
  const char *name = getenv("IDLOOP_CLOCK_OFFSET");
  int file = name ? open(name, O_RDONLY) : -1;
  real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
  if (file >= 0) {
    void *there = mmap(NULL, sizeof *offset, PROT_READ, MAP_SHARED, file, 0);
    if (there != MAP_FAILED) offset = there;
  }
}

int clock_gettime(clockid_t clock, struct timespec *now) {
  if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
  int failed = real(clock, now);
  if (!failed && offset && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) {
    int64_t moved = now->tv_sec * INT64_C(1000000000) + now->tv_nsec + *offset;
    now->tv_sec = moved / INT64_C(1000000000);
    now->tv_nsec = moved % INT64_C(1000000000);
  }
  return failed;
}

int gettimeofday(struct timeval *now, void *zone) {
  struct timespec precise;
  (void)zone;
  int failed = clock_gettime(CLOCK_REALTIME, &precise);
  now->tv_sec = precise.tv_sec;
  now->tv_usec = precise.tv_nsec / 1000;
  return failed;
}

time_t time(time_t *there) {
  struct timespec precise;
  clock_gettime(CLOCK_REALTIME, &precise);
  if (there) *there = precise.tv_sec;
  return precise.tv_sec;
}

static struct timespec at(const struct timespec *wanted) {
  struct timespec there = *wanted;
  if (offset && there.tv_sec > 1000000000) {
    int64_t moved = there.tv_sec * INT64_C(1000000000) + there.tv_nsec - *offset;
    there.tv_sec = moved / INT64_C(1000000000);
    there.tv_nsec = moved % INT64_C(1000000000);
  }
  return there;
}

int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex, const struct timespec *wanted) {
  static int (*own)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
  struct timespec there = at(wanted);
  if (!own) own = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
  return own(condition, mutex, &there);
}

int pthread_cond_clockwait(pthread_cond_t *condition, pthread_mutex_t *mutex, clockid_t clock,
                           const struct timespec *wanted) {
  static int (*own)(pthread_cond_t *, pthread_mutex_t *, clockid_t, const struct timespec *);
  struct timespec there = at(wanted);
  if (!own) own = dlsym(RTLD_NEXT, "pthread_cond_clockwait");
  return own(condition, mutex, clock, &there);
}

int sem_timedwait(sem_t *semaphore, const struct timespec *wanted) {
  static int (*own)(sem_t *, const struct timespec *);
  struct timespec there = at(wanted);
  if (!own) own = dlsym(RTLD_NEXT, "sem_timedwait");
  return own(semaphore, &there);
}

int pthread_mutex_timedlock(pthread_mutex_t *mutex, const struct timespec *wanted) {
  static int (*own)(pthread_mutex_t *, const struct timespec *);
  struct timespec there = at(wanted);
  if (!own) own = dlsym(RTLD_NEXT, "pthread_mutex_timedlock");
  return own(mutex, &there);
}
