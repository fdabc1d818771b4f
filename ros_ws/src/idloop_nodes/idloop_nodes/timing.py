"""How a loop is timed and scheduled: deadlines, bursts, simulated time, priorities."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

SLACK = 0.1  # seconds that are made up for: what a late wake-up loses, not what a computation takes
ARRIVED = 0.4e-3  # seconds after the instant of a measurement at which it has come over to us as well
LONGER = 0.001  # seconds by which bursts are drawn apart, or together again, at a time
LONGEST = 0.01  # seconds
MOST_SHARE, LITTLE_SHARE = 0.235, 0.2  # of a core: above it bursts are drawn apart, below it together
WEIGH_PERIOD = 0.5  # seconds over which the share is taken
OTHER_CLOCK = 1.0  # seconds; a sample of this age was not late: its stamps are of another clock
Scheduling = Literal["normal", "batch", "preferred"]
THREADS = Path("/proc/self/task")
GROUP = Path("/proc/self/autogroup")
PREFERENCE = -10  # niceness: ten times the share of an ordinary process where there is not enough for all, never all


class Deadlines:
    """Instants ``start + k * period``; a sleep to an absolute instant does not drift as a timer does."""

    def __init__(self, period_ns: int) -> None:
        self.period_ns = period_ns
        self.missed = 0  # deadlines at which the caller came more than a period late
        self._start_ns = 0
        self._steady_start = 0

    def start(self, phase: float = 0.0, lead_ns: int = 20_000_000) -> int:
        """Put the grid on whole periods of the system clock, deadlines a `phase` behind; return its first stamp."""
        system, steady = time.time_ns(), time.monotonic_ns()
        self._start_ns = (system + lead_ns) // self.period_ns * self.period_ns
        self._steady_start = steady + self._start_ns - system + round(phase * self.period_ns)
        return self._start_ns

    def wait(self, index: int) -> int:
        """Sleep until deadline `index`; return the system time of now on the same clock (nanoseconds)."""
        target = self._steady_start + index * self.period_ns
        now = time.monotonic_ns()
        while now < target:
            time.sleep((target - now) / 1e9)
            now = time.monotonic_ns()
        self.missed += now - target > self.period_ns
        return self._start_ns + now - self._steady_start


def become_urgent(priority: int = 20) -> bool:
    """Ask for real-time scheduling of the calling thread and of those it starts; return whether it was granted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, AttributeError):
        return False
    return True


class Pace:
    """Holds simulated time back to `factor` seconds in a second of the wall clock; 0: as many as there can be.

    What was lost while others held it back is not made up for: an experiment after a long computation would
    otherwise be over at once.
    """

    def __init__(self, factor: float) -> None:
        self._factor = factor
        self._begun: float | None = None

    def early(self, simulated: float, now: float) -> bool:
        """Whether it is too early, at the steady time `now`, for this simulated time since the start of the run [s]."""
        if self._factor <= 0.0:
            return False
        due = simulated / self._factor
        if self._begun is None:
            self._begun = now - due
        behind = now - self._begun - due
        self._begun += max(behind - SLACK, 0.0)
        return behind < 0.0


class Bursts:
    """Instants of bursts: one costs as much as several samples, so few are cheap, and many are quick.

    Where stamps are of the clock that runs here, a burst comes just after a sample: at any other instant the newest
    would be older by up to a period. Where the same work takes more of a core, because others crowd its caches or it
    runs on a slower machine, bursts are drawn apart until it takes less than a quarter of one.
    """

    def __init__(self, length: float, period: float = 0.0) -> None:
        self.wait = length  # time until the next burst [s]
        self._shortest = self._length = length
        self._period = period  # of the samples [s]; 0 where their clock is another one
        self._arrived = min(ARRIVED, 0.5 * period)
        self._next = 0.0
        self._weighed: tuple[float, float] | None = None

    def due(self, now: float) -> bool:
        """Whether it is time for a burst, at the steady time `now` [s]."""
        self.wait = self._next - now
        return self.wait <= 0.0

    def plan(self, now: float, age: float | None = None) -> None:
        """Choose the next instant after a burst whose newest sample had this age [s]; None: it brought none."""
        self.wait = self._length
        if self._period and age is not None and 0.0 <= age < OTHER_CLOCK:
            # After a long computation this lies in the past: what came meanwhile is taken at once.
            samples = max(1, round(self._length / self._period))
            self.wait = max(samples * self._period + self._arrived - age, 0.0)
        self._next = now + self.wait

    def weigh(self, now: float, spent: float) -> None:
        """Draw the bursts apart or together by the processor time that the process has spent so far [s]."""
        if self._weighed is None:
            self._weighed = now, spent
            return
        passed = now - self._weighed[0]
        if passed < WEIGH_PERIOD:
            return
        share = (spent - self._weighed[1]) / passed
        self._weighed = now, spent
        if share > MOST_SHARE:
            self._length = min(self._length + LONGER, max(LONGEST, self._shortest))
        elif share < LITTLE_SHARE:
            self._length = max(self._length - LONGER, self._shortest)


def use_scheduling(kind: Scheduling) -> None:
    """Schedule the threads of this process, and those they start."""
    if kind == "batch":
        use_batch_scheduling()
    elif kind == "preferred":
        raise_share()


def use_batch_scheduling() -> None:
    """Let the threads of this process, and those they start, wake up without pushing another aside.

    For listeners that may lag behind. A message wakes a thread; where that one at once takes the place of the sender,
    each message costs two changes of threads, and the next finds it asleep again. Where it waits, several messages
    wake it once.
    """
    if hasattr(os, "SCHED_BATCH"):
        _for_all_threads(lambda thread: os.sched_setscheduler(thread, os.SCHED_BATCH, os.sched_param(0)))


def raise_share() -> None:
    """Ask for a larger share for the threads of this process, and those they start.

    For listeners that must keep up with the clock on a machine that others use as well. Unlike a real-time schedule
    it takes nothing from a loop with deadlines and never keeps a service from being answered.
    """
    if hasattr(os, "setpriority"):
        _for_all_threads(lambda thread: os.setpriority(os.PRIO_PROCESS, thread, PREFERENCE))
        # Linux shares out by session first, and niceness counts only within one; another's session is not ours to move.
        if GROUP.is_file() and os.getsid(0) == os.getpid():
            with contextlib.suppress(OSError):
                GROUP.write_text(str(PREFERENCE), encoding="ascii")


def _for_all_threads(ask: Callable[[int], None]) -> None:
    if not THREADS.is_dir():
        return
    for thread in THREADS.iterdir():
        try:
            ask(int(thread.name))
        except OSError:  # a thread that has ended meanwhile, or a system that forbids it: it only costs time
            continue
