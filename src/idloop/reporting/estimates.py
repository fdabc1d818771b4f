"""Numbers for a reader: as many digits as the interval lets stand, with a true minus sign."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from idloop.diagnosis.candidate import effect_parameters

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.physics import Model
    from idloop.physics.parameter import Parameter

NORMAL_95 = 1.959963984540054
_MOST_DIGITS = 8


def parameter_estimates(model: Model) -> dict[str, dict[str, Any]]:
    """Free parameters of a fitted model, as the document of a fit has them.

    Returns
    -------
    dict
        ``value``, ``stderr``, ``interval`` (95 %), ``unit``, ``at_bound`` by the name of the parameter; None where
        it is not determined.
    """
    found = {}
    for parameter in model.parameters:
        if not parameter.free:
            continue
        stderr = parameter.stderr
        known = stderr is not None and math.isfinite(stderr)
        reach = NORMAL_95 * stderr if known and stderr is not None else math.nan
        found[parameter.name] = {
            "value": parameter.value,
            "stderr": stderr if known else None,
            "interval": [parameter.value - reach, parameter.value + reach] if known else [None, None],
            "unit": parameter.unit,
            "at_bound": parameter.value in (parameter.min, parameter.max),
        }
    return found


def held_parameters(ladder: Ladder) -> dict[str, Parameter]:
    """Parameters of added effects that were held then: no estimates. Without those that a search has chosen."""
    known = {p.name: p for p in ladder.model.parameters}
    return {
        f"{name}.{own}": known[f"{name}.{own}"]
        for name in ladder.added
        for own, entry in effect_parameters(ladder.model, name).items()
        if entry["held"]
    }


def read_off_parameters(ladder: Ladder) -> dict[str, Parameter]:
    """Parameters of added effects that were read off the data without a fit, such as a resolution."""
    return {
        f"{active.name}.{spec.name}": ladder.model.parameter(f"{active.name}.{spec.name}")
        for active in ladder.model.effects
        if active.effect.final and active.name in ladder.added
        for spec in active.effect.parameters
    }


def figure_text(value: float | None, digits: int = 4) -> str:
    """Write a number with a few digits; "–" where there is none."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0.0 else "−∞"
    return _tidy(f"{value:.{digits}g}")


def percent_text(value: float | None, digits: int = 3) -> str:
    """Write a percentage with a few digits, a large one as a whole number: "83.7", "−4580"."""
    if value is not None and 1.0 <= abs(value) < 10.0**_MOST_DIGITS:
        digits = max(digits, math.floor(math.log10(abs(value))) + 1)
    return figure_text(value, digits)


def fit_text(value: float | None, digits: int = 4) -> str:
    """Write a FIT [%] as `percent_text`, and with more digits where it would look perfect and is not: "99.96"."""
    if value is not None and math.isfinite(value):
        while value < 100.0 and digits < _MOST_DIGITS and float(f"{value:.{digits}g}") >= 100.0:
            digits += 1
    return percent_text(value, digits)


def with_interval(value: float, stderr: float | None) -> str:
    """Write an estimate with its 95 % interval, both to the interval's second digit: "20.34 ± 0.40"."""
    if stderr is None or not math.isfinite(stderr) or stderr <= 0.0 or not math.isfinite(value):
        return figure_text(value)
    half = NORMAL_95 * stderr
    # Two digits of the interval; of the value as many places, but never fewer than one digit.
    place = math.floor(math.log10(half)) - 1
    size = max(abs(value), half)
    power = math.floor(math.log10(size))
    if -5 < power < 6:
        places = max(-place, 0)
        return _tidy(f"{value:.{places}f} ± {half:.{places}f}")
    scale = 10.0**power
    places = max(power - place, 0)
    return f"({_tidy(f'{value / scale:.{places}f} ± {half / scale:.{places}f}')}) · 10{_raised(power)}"


def _tidy(text: str) -> str:
    if "e" in text:
        head, _, power = text.partition("e")
        return f"{head.replace('-', '−')} · 10{_raised(int(power))}"
    return text.replace("-", "−")


def _raised(power: int) -> str:
    return str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
