"""Keeps a stream below a rate by leaving samples out. No ROS and no clock in here."""

from __future__ import annotations

from idloop.records.bags.cdr import SECOND

# Samples by which a stream may be ahead of the rate: stamps vary, and a stream that was held up catches up.
BURST = 20


class Decimator:
    """Passes samples up to a mean rate, as a leaky bucket.

    `rate`: largest rate [Hz]. Attributes: `left_out`: samples that were not passed.
    """

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
