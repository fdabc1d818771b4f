"""Absolute deadlines on a grid of the system clock, kept by the steady clock."""

from __future__ import annotations

import os
import time


class Deadlines:
    """Instants ``start + k * period``; a sleep to an absolute instant does not drift as a timer does.

    `period_ns`: time between deadlines. Attributes: `missed`: deadlines at which the caller came more than a period
    late.
    """

    def __init__(self, period_ns: int) -> None:
        self.period_ns = period_ns
        self.missed = 0
        self._start_ns = 0
        self._steady_start = 0

    def start(self, phase: float = 0.0, lead_ns: int = 20_000_000) -> int:
        """Put the grid on whole periods of the system clock; return its first stamp (nanoseconds).

        `phase`: part of a period by which the deadlines lie behind the stamps; `lead_ns`: how long before the first
        deadline.
        """
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
