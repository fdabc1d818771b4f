"""Keeps a stream below a rate by leaving samples out. No ROS and no clock in here."""

from __future__ import annotations

SECOND = 1_000_000_000
# Stamps of a steady stream vary: a sample that is this share of a period early is not left out.
EARLY = 0.1


class Decimator:
    """Passes a sample when the period of the largest rate has gone by since the one before.

    Parameters
    ----------
    rate : float
        Largest rate [Hz].

    Attributes
    ----------
    left_out : int
        Samples that were not passed.
    """

    def __init__(self, rate: float) -> None:
        self.left_out = 0
        self._least_ns = (1.0 - EARLY) * SECOND / rate
        self._passed: int | None = None

    def passes(self, stamp_ns: int) -> bool:
        """Return whether the sample of this stamp [ns] is passed; one from before the last was, too."""
        if self._passed is not None and 0 <= stamp_ns - self._passed < self._least_ns:
            self.left_out += 1
            return False
        self._passed = stamp_ns
        return True
