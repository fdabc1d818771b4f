"""Counts and rates for the health report."""

from __future__ import annotations

import time


class RateCounter:
    """Counts events and gives their rate since the last question."""

    def __init__(self) -> None:
        self.count: float = 0
        self._count_then: float = 0
        self._then = time.monotonic()

    def rate(self) -> float:
        """Events per second since the last call."""
        now = time.monotonic()
        elapsed = max(now - self._then, 1e-9)
        result = (self.count - self._count_then) / elapsed
        self._count_then, self._then = self.count, now
        return result
