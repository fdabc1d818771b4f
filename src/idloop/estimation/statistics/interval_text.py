"""Text of an interval, with as many digits as its width needs."""

from __future__ import annotations

import math

# Least and most significant digits of the ends, and how many of them show the width.
_FEWEST, _MOST, _OF_WIDTH = 5, 15, 2


def interval_text(low: float, high: float, fewest: int = _FEWEST) -> str:
    """Text such as ``"0.00019998 .. 0.00020002"``; "not determined" where an end is not finite.

    `fewest`: digits where the width needs no more.
    """
    if not (math.isfinite(low) and math.isfinite(high)):
        return "not determined"
    width, size = high - low, max(abs(low), abs(high))
    needed = math.floor(math.log10(size)) - math.floor(math.log10(width)) + _OF_WIDTH if width > 0.0 else fewest
    digits = min(max(needed, fewest), _MOST)
    return f"{low:.{digits}g} .. {high:.{digits}g}"
