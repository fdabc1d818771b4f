"""Rates of events for the health report, a stream kept below a rate, and a wait to report."""

from __future__ import annotations

import time
from collections.abc import Hashable

from idloop.records.bags.cdr import SECOND

# Samples by which a stream may be ahead of the rate: stamps vary, and a stream that was held up catches up.
BURST = 20
TIMEOUT = 20.0  # seconds without a step; a fit of all data may take as long
FIRST_TIMEOUT = 5.0  # seconds without a confirmation of the first sample


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


class Decimator:
    """Passes samples up to a mean rate [Hz], as a leaky bucket; counts those that it has left out."""

    def __init__(self, rate: float) -> None:
        self.left_out = 0
        self._rate = rate
        self._ahead = 0.0  # samples by which those that were passed are ahead of the rate
        self._last: int | None = None

    def passes(self, stamp_ns: int) -> bool:
        """Return whether the sample of this stamp [ns] is passed; one from before the last restarts the count."""
        last, self._last = self._last, stamp_ns
        if last is None or stamp_ns < last:
            self._ahead = 1.0
            return True
        self._ahead = max(self._ahead - (stamp_ns - last) / SECOND * self._rate, 0.0)
        if self._ahead + 1.0 > BURST:
            self.left_out += 1
            return False
        self._ahead += 1.0
        return True


class StallNotice:
    """Notes what a node waits for."""

    def __init__(self) -> None:
        self._what: Hashable = None
        self._since = 0.0
        self._reported = False

    def due(self, what: Hashable, now: float, timeout: float | None = None) -> bool:
        """Whether to report a wait for `what`, not reported yet and longer than `timeout` [s]; None ends a wait."""
        if what != self._what:
            self._what, self._since, self._reported = what, now, False
        if what is None or self._reported or now - self._since < (TIMEOUT if timeout is None else timeout):
            return False
        self._reported = True
        return True
