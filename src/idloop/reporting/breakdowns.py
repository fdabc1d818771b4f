"""An error along one variable: where its bins are drawn, its main finding in words, and which variable is shown first.

The printed figure, the report and the workbench draw and say the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.validation.breakdown import Breakdown
from idloop.validation.variables import TITLES
from idloop.validation.where import ErrorMap
from idloop.validation.words import percent, short

Array = NDArray[np.float64]

# Worst stretches that are marked in a figure over time.
MARKED_STRETCHES = 3
# Share of an error from which on a curve over one variable is worth a sentence.
_CURVE = 0.25
# Variables whose curve says what to look for; over time and frequency every error varies.
_PHYSICAL = ("velocity", "position", "command", "direction", "since_reversal")


def bin_edges(breakdown: Breakdown) -> Array:
    """Edges of the bins on the axis: the variable's own where they are ranges on a plain or logarithmic axis."""
    if breakdown.edges is None or breakdown.variable == "since_reversal":
        return np.arange(len(breakdown.names) + 1.0)
    if breakdown.variable == "frequency":
        return np.concatenate([[0.5 * breakdown.edges[1]], breakdown.edges[1:]])
    return breakdown.edges


def bins(breakdown: Breakdown) -> dict[str, Any]:
    """Columns of a breakdown as it is drawn, a row for each bin.

    Returns
    -------
    dict
        ``left``, ``right`` (ends on the axis), ``mean``, ``rms``, ``low``, ``high`` (the mean less and plus the
        standard deviation about it; all NaN in an empty bin), ``error`` and ``usual`` [%], ``name``.
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
    """Name a model with the size of its error, or with the kind of error where kinds differ: no sizes to compare."""
    label, one = maps[index]
    if len({other.kind for _, other in maps}) > 1:
        return f"{label}: {one.kind}"
    return f"{label} (rms {short(one.rms)} {one.unit})"


def along_text(breakdown: Breakdown) -> str:
    """What a figure over a variable shows: where the error is largest for its time, and what a curve makes up of it."""
    if not math.isfinite(breakdown.follows):
        return breakdown.worst.text
    return (
        f"{breakdown.worst.text}; a curve over {TITLES[breakdown.variable]} makes up {percent(breakdown.follows)} of it"
    )


def shown_first(maps: Sequence[ErrorMap]) -> tuple[str, str] | None:
    """Error and variable that a reader should see first.

    Parameters
    ----------
    maps : sequence of ErrorMap
        Of one model on one record.

    Returns
    -------
    tuple of (str, str), or None
        Name of the error and the variable; a notable one where there is any. None without a breakdown.
    """
    # The force is free of the drift of a free run, which follows whatever moves slowly; a reason against it is noise.
    considered = [one for one in maps if one.basis == "force" and not one.why] or list(maps)
    ranked = [
        (is_notable(b), b.variable in _PHYSICAL, float(np.nan_to_num(b.follows)), one.name, b.variable)
        for one in considered
        for b in one.breakdowns
    ]
    if not ranked:
        return None
    notable, _, _, name, variable = max(ranked)
    one = next(one for one in considered if one.name == name)
    # Where nothing says anything, velocity is what a reader looks at first.
    return name, variable if notable or one.along("velocity") is None else "velocity"


def is_notable(breakdown: Breakdown) -> bool:
    """Whether a part of the data stands out along a variable, or a curve over it makes up a quarter of the error."""
    return breakdown.stands_out or (math.isfinite(breakdown.follows) and breakdown.follows >= _CURVE)
