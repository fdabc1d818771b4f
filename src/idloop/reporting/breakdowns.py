"""An error along one variable: where its bins are drawn, its main finding in words, and which variable is shown first.

The printed figure, the report and the workbench draw and say the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.validation.breakdown import Breakdown
from idloop.validation.variables import TITLES
from idloop.validation.where import NOISE_ALONE, ErrorMap
from idloop.validation.words import percent, short

# Worst stretches that are marked in a figure over time.
MARKED_STRETCHES = 3
# Share of an error from which on a curve over one variable is worth a sentence.
_CURVE = 0.25


def bin_edges(breakdown: Breakdown) -> Array:
    """Edges of the bins on the axis: the variable's own where they are ranges on a plain or logarithmic axis."""
    if breakdown.edges is None or breakdown.variable == "since_reversal":
        return np.arange(len(breakdown.names) + 1.0)
    if breakdown.variable == "frequency":
        return np.concatenate([[0.5 * breakdown.edges[1]], breakdown.edges[1:]])
    return breakdown.edges


def bins(breakdown: Breakdown) -> dict[str, Any]:
    """Columns of a breakdown as it is drawn, a row for each bin; NaN in an empty one.

    ``left`` and ``right`` are its ends on the axis, ``low`` and ``high`` the mean less and plus the standard deviation
    about it; ``error`` and ``usual`` in %.
    """
    edges = bin_edges(breakdown)
    deviation = np.sqrt(np.maximum(breakdown.rms**2 - breakdown.mean**2, 0.0))
    return {
        "left": edges[:-1],
        "right": edges[1:],
        "mean": breakdown.mean,
        "rms": breakdown.rms,
        "low": breakdown.mean - deviation,
        "high": breakdown.mean + deviation,
        "error": np.round(100.0 * breakdown.error, 1),
        "usual": np.round(100.0 * breakdown.usual, 1),
        "name": list(breakdown.names),
    }


def named_ticks(breakdown: Breakdown) -> dict[float, str]:
    """Ticks with their labels where bins are no ranges of a plain axis; empty where they are."""
    if breakdown.variable == "direction":
        return {0.5: "−", 1.5: "0", 2.5: "+"}
    if breakdown.variable == "since_reversal" and breakdown.edges is not None:
        return {float(place): f"{edge:.2g}" for place, edge in enumerate(breakdown.edges)}
    if breakdown.variable == "position" and breakdown.circular:
        return {float(angle): str(angle) for angle in range(0, 361, 90)}
    return {}


def axis_name(breakdown: Breakdown) -> tuple[str, str]:
    """Title and unit of the axis of a variable."""
    return TITLES[breakdown.variable], "sign" if breakdown.variable == "direction" else breakdown.unit


def legend_entry(maps: Sequence[tuple[str, ErrorMap]], index: int) -> str:
    """Name a model with the size of its error."""
    label, one = maps[index]
    return f"{label} (rms {short(one.rms)} {one.unit})"


def measured_error(one: ErrorMap) -> str:
    """Which error a figure is of: "motor.velocity: free-run error"."""
    return f"{one.name}: {one.kind}"


def comparable(maps: Sequence[tuple[str, ErrorMap]]) -> list[tuple[str, ErrorMap]]:
    """Errors that one axis may hold: of the kind of the last one."""
    return [(label, one) for label, one in maps if one.kind == maps[-1][1].kind]


def along_text(breakdown: Breakdown) -> str:
    """What a figure over a variable shows: where the error stands out, and what a curve makes up of it.

    A part that holds about as much of the error as of the time is no finding.
    """
    title = TITLES[breakdown.variable]
    part = breakdown.worst.text if breakdown.stands_out else ""
    if not math.isfinite(breakdown.follows):
        return part or f"no part of the {title} stands out"
    curve = f"a curve over {title} makes up {percent(breakdown.follows)} of"
    return f"{part}; {curve} it" if part else f"{curve} the error, and no part of it stands out"


def _curve(breakdown: Breakdown) -> float:
    """Share of the error that a curve over the variable makes up."""
    return float(breakdown.follows) if math.isfinite(breakdown.follows) else 0.0


def shown_first(maps: Sequence[ErrorMap]) -> tuple[str, str] | None:
    """Error of one model on one record, and variable, that a reader should see first; None without a breakdown.

    It shows most of the error beyond what its share of the time would be. Over frequency every error is spread
    otherwise than the signal, so that it comes last.
    """
    # The force is free of the drift of a free run, which follows whatever moves slowly; a reason against it is noise.
    considered = [one for one in maps if one.basis == "force" and not one.why]
    considered = considered or [one for one in maps if one.why != NOISE_ALONE] or list(maps)
    ranked = [
        (
            b.variable in notable_variables(one),
            b.variable != "frequency",
            max(b.worst.error - b.worst.usual, _curve(b)),
            one.name,
            b.variable,
        )
        for one in considered
        for b in one.breakdowns
    ]
    if not ranked:
        return None
    notable, _, _, name, variable = max(ranked)
    one = next(one for one in considered if one.name == name)
    # Where nothing says anything, velocity is what a reader looks at first.
    return name, variable if notable or one.along("velocity") is None else "velocity"


def notable_variables(one: ErrorMap) -> list[str]:
    """Variables along which an error says something; none where the sensor noise may be all of it."""
    return [b.variable for b in one.breakdowns if is_notable(b)] if one.why != NOISE_ALONE else []


def is_notable(breakdown: Breakdown) -> bool:
    """Whether a part of the data stands out along a variable, or a curve over it makes up a quarter of the error."""
    return breakdown.stands_out or _curve(breakdown) >= _CURVE
