"""Text of ranges, shares and numbers."""

from __future__ import annotations

import math

_NOTHING = 1e-3  # three digits of the scale
_MOST_DIGITS = 8
# Percent beyond which a number is worse to read than a factor.
_BEYOND = 1000.0
# Factor from which on only its size counts.
_HUGE = 1e5


def percent(share: float) -> str:
    """Text of a share in whole percents, with one digit more below one percent."""
    value = 100.0 * share
    if value >= 0.95 or value <= 0.0:
        return f"{value:.0f} %"
    return f"{value:.1f} %" if value >= 0.05 else "< 0.1 %"


def short(value: float) -> str:
    """Write a number with three digits and a true minus sign."""
    return tidy(f"{value:.3g}") if value else "0"


def figure_text(value: float | None, digits: int = 4) -> str:
    """Write a number with a few digits; "–" where there is none."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0.0 else "−∞"
    return tidy(f"{value:.{digits}g}")


def fit_text(value: float | None, digits: int = 4, unit: str = "") -> str:
    """Write a FIT [%], with more digits where it would look perfect and is not: "99.96".

    Below -1000 % it is a factor in words, without a number where that is infinite. `unit` follows a number, as " %"
    does in a sentence.
    """
    if value == -math.inf:
        return "worse than a constant"
    if value is not None and math.isfinite(value):
        if value < -_BEYOND:
            factor = 1.0 - 0.01 * value
            # Who diverges has no use for seven digits.
            return (
                f"worse than a constant by a factor {_whole(factor, 2) if factor < _HUGE else figure_text(factor, 2)}"
            )
        while value < 100.0 and digits < _MOST_DIGITS and float(f"{value:.{digits}g}") >= 100.0:
            digits += 1
    return _whole(value, digits) + _unit(value, unit)


def force_text(relative: float | None, digits: int = 3, unit: str = "") -> str:
    """Write a force error, given as a part of the commanded force, in percent; above 1000 % as a factor in words."""
    value = None if relative is None else 100.0 * relative
    if value is not None and math.isfinite(value) and value > _BEYOND:
        return f"{_whole(0.01 * value, 2)} times the commanded force"
    return _whole(value, digits) + _unit(value, unit)


def _whole(value: float | None, digits: int) -> str:
    """Digits of the whole part, all of them, before any after the point."""
    if value is not None and 1.0 <= abs(value) < 10.0**_MOST_DIGITS:
        digits = max(digits, math.floor(math.log10(abs(value))) + 1)
    return figure_text(value, digits)


def _unit(value: float | None, unit: str) -> str:
    return unit if value is not None and math.isfinite(value) else ""


def tidy(text: str) -> str:
    """A number as Python writes it, with a true minus sign and its power of ten as an exponent."""
    if "e" in text:
        head, _, power = text.partition("e")
        return f"{head.replace('-', '−')} · 10{raised(int(power))}"
    return text.replace("-", "−")


def raised(power: int) -> str:
    """A whole number as an exponent."""
    return str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def beside(value: float, scale: float) -> str:
    """As `short`; 0 for a number that is negligible beside a scale in its own unit."""
    return short(value) if abs(value) >= _NOTHING * scale else "0"


def range_text(variable: str, low: float, high: float, unit: str) -> str:
    """Text of a range of a variable, to follow "of the time" or "the error is".

    `variable`: see `idloop.validation.breakdown.Breakdown`; `low`, `high`: in the unit; `unit`: "°" for positions means
    that they are counted over a turn.
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
