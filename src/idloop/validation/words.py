"""Text of ranges, shares and numbers."""

from __future__ import annotations

import math

_NOTHING = 1e-3  # three digits of the scale


def percent(share: float) -> str:
    """Text of a share in whole percents, with one digit more below one percent."""
    value = 100.0 * share
    if value >= 0.95 or value <= 0.0:
        return f"{value:.0f} %"
    return f"{value:.1f} %" if value >= 0.05 else "< 0.1 %"


def short(value: float) -> str:
    """Write a number with three digits and a true minus sign."""
    return f"{value:.3g}".replace("-", "−") if value else "0"


def beside(value: float, scale: float) -> str:
    """As `short`; 0 for a number that is negligible beside a scale in its own unit."""
    return short(value) if abs(value) >= _NOTHING * scale else "0"


def range_text(variable: str, low: float, high: float, unit: str) -> str:
    """Text of a range of a variable, to follow "of the time" or "the error is".

    Parameters
    ----------
    variable : str
        See `idloop.validation.breakdown.Breakdown`.
    low, high : float
        In the unit.
    unit : str
        "°" for positions means that they are counted over a turn.
    """
    a, b = short(low), short(high)
    if variable == "time":
        return f"from {a} to {b} s"
    if variable == "frequency":
        return f"below {b} Hz" if low <= 0.0 else f"between {a} and {b} Hz"
    if variable == "since_reversal":
        if math.isinf(high):
            return f"later than {a} s after a reversal" if low > 0.0 else "after a reversal"
        return f"{a} to {b} s after a reversal" if low > 0.0 else f"within {b} s after a reversal"
    if variable == "command":
        return f"with a command between {a} and {b} {unit}"
    if variable == "position" and unit == "°":
        return f"between {a}° and {b}° of a turn"
    what = {"velocity": "at velocities", "position": "at positions"}[variable]
    return f"{what} between {a} and {b} {unit}"


def levels_text(variable: str, low: float, high: float, unit: str) -> str:
    """Text of a range of the levels of a signal with only a few."""
    if low == high:
        return f"with a {variable} of {short(low)} {unit}"
    return f"with a {variable} of {short(low)} to {short(high)} {unit}"
