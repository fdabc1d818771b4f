"""Velocity of an axis that measures its position only."""

from __future__ import annotations

from collections import deque

from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec.joints import NAN


class VelocityEstimator:
    """Slope of the positions over a short window.

    `window_ns`: least distance of the two positions that are compared: short ones show the encoder's steps.
    """

    def __init__(self, window_ns: int = 20_000_000) -> None:
        self._window_ns = window_ns
        self._positions: deque[tuple[int, float]] = deque()

    def clear(self) -> None:
        """Forget everything: the stamps have a new beginning."""
        self._positions.clear()

    def take(self, stamp_ns: int, position: float) -> float:
        """Return the velocity at a new position; NaN before the first window is full."""
        positions = self._positions
        positions.append((stamp_ns, position))
        while len(positions) > 2 and stamp_ns - positions[1][0] >= self._window_ns:
            positions.popleft()
        elapsed = stamp_ns - positions[0][0]
        return (position - positions[0][1]) * SECOND / elapsed if elapsed >= self._window_ns else NAN
