"""Numbers for a reader: as many digits as the interval lets stand, with a true minus sign."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from idloop.diagnosis.candidate import effect_parameters
from idloop.reporting.terms import effect_words
from idloop.validation.words import figure_text, raised, tidy

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.physics import Model
    from idloop.physics.parameter import Parameter

NORMAL_95 = 1.959963984540054
_FAR_BELOW = 1e-4  # of a value
_AT_BOUND = 1e-6  # of a standard error, from a bound


def parameter_estimates(model: Model) -> dict[str, dict[str, Any]]:
    """Free parameters of a fitted model, as the document of a fit has them.

    Returns: ``value``, ``stderr``, ``interval`` (95 %), ``unit``, ``at_bound`` by the name of the parameter; None where
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
            "at_bound": at_bound(parameter) is not None,
        }
    return found


def at_bound(parameter: Parameter) -> float | None:
    """The bound at which an estimate ended; None where it is not at one.

    A search with an inertia stops short of 0, at a distance that its standard error does not show.
    """
    near = _AT_BOUND * (parameter.stderr or 0.0)
    bounds = (parameter.min, parameter.max) if parameter.free else ()
    return next((bound for bound in bounds if abs(parameter.value - bound) <= near), None)


def not_determined(model: Model) -> list[str]:
    """A sentence for each estimate that ended at a bound: what the data say of it all the same."""
    lines = []
    for name, one in parameter_estimates(model).items():
        parameter = model.parameter(name)
        bound = at_bound(parameter)
        if bound is None:
            continue
        low, high = one["interval"]
        limit = high if bound == parameter.min else low
        where = "below" if bound == parameter.min else "above"
        known = (
            "" if limit is None else f", only that it is {where} {limit:.3g} {one['unit']} (95 %)".replace(" - (", " (")
        )
        lines.append(f"{name} ended at its bound: the data do not determine it{known}")
    return lines


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


def parameter_rows(model: Model, held: Collection[str] = ()) -> list[dict[str, str]]:
    """Rows of a table of all parameters of a fitted model.

    `held`: parameters that are no part of the machine's description and were not estimated.
    Returns: ``key``, ``name`` in words, ``value`` with its 95 % interval, ``unit``, ``bounds`` (empty where there are
    none, or nothing is estimated), and ``kind``: estimated, at its bound, held or known.
    """
    rows = []
    for one in model.parameters:
        free = "estimated" if one.stderr is not None else "free, not fitted yet"
        # At a bound an interval about the value says nothing.
        bound = at_bound(one) is not None
        rows.append(
            {
                "key": one.name,
                "name": effect_words(one.name.replace(".", " ")),
                "value": with_interval(one.value, one.stderr if one.free and not bound else None),
                "unit": one.unit.strip("-"),
                "bounds": _bounds(one) if one.free else "",
                "kind": "at its bound" if bound else free if one.free else "held" if one.name in held else "known",
            }
        )
    return rows


def _bounds(one: Parameter) -> str:
    """Bounds in words; a lower one far below the value keeps it above zero, and its number says nothing."""
    low, high = (figure_text(bound, 3) for bound in (one.min, one.max))
    if math.isfinite(one.max):
        return f"{low} to {high}".replace("−∞ to", "at most")
    if not math.isfinite(one.min):
        return ""
    return "above 0" if 0.0 < one.min <= _FAR_BELOW * abs(one.value) else f"at\u00a0least\u00a0{low}"


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
        return tidy(f"{value:.{places}f} ± {half:.{places}f}")
    scale = 10.0**power
    places = max(power - place, 0)
    return f"({tidy(f'{value / scale:.{places}f} ± {half / scale:.{places}f}')}) · 10{raised(power)}"


def parameter_text(name: str, entry: Mapping[str, Any]) -> str:
    """Text of a parameter with its 95 % interval: "width 0.1210 ± 0.0021 V"; "(held)" where it was not estimated."""
    value, stderr, unit = entry.get("value"), entry.get("stderr"), (entry.get("unit") or "").strip("-")
    if value is None:
        return f"{name} -"
    # Without an error it was read off the data.
    number = figure_text(value, 6) if stderr == 0.0 else with_interval(value, stderr)
    return f"{name} {number} {unit}".rstrip() + (" (held)" if entry.get("held") else "")


def parameters_text(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Text of all parameters of an effect."""
    return ", ".join(parameter_text(name, entry) for name, entry in parameters.items())


def tie_text(tied: Sequence[str]) -> str:
    """Sentence about effects that the data cannot tell from the best one; empty without any."""
    if len(tied) < 2:
        return ""
    return f"this data cannot tell {tied[0]} from {', '.join(tied[1:])} (marked =)"
