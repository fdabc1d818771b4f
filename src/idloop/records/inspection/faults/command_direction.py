"""Command and motion turned against each other: a positive command accelerates the axis backwards.

Then it also takes power from the motion on average, which a drive never does: friction needs power.
"""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import response

# Standard errors of the gain below zero, and the share of the acceleration that it explains.
_ERRORS, _SHARE = 6.0, 0.2


def check(axis: Axis) -> list[Finding]:
    """Estimate the sign of the acceleration that the command gives."""
    found = response(axis, _SHARE)
    if found is None or found.certainty > -_ERRORS or _power(axis) > 0.0:
        return []
    name, unit = axis.command_name, axis.unit("command")
    motion = axis.unit("position").removesuffix("/s")
    return [
        fault(
            "turned_command",
            name,
            f"a positive {name} accelerates {axis.joint} backwards ({found.gain:.3g} ± {found.error:.1g} {motion}/s²"
            f" per {unit}, {100 * found.share:.0f} % of it explained): the signs of command and motion differ",
            f"set `scale: -1` for {name} in the mapping, or allow a negative gain in the model file",
            evidence={"gain": found.gain, "error": found.error, "share": found.share},
            spoils=("identification",),
        )
    ]


def is_forwards(axis: Axis) -> bool:
    """Whether a positive command accelerates an axis forwards beyond doubt, and gives power to the motion."""
    found = response(axis, _SHARE)
    return found is not None and found.certainty > _ERRORS and _power(axis) > 0.0


def _power(axis: Axis) -> float:
    """Mean of command times speed."""
    return 0.0 if axis.grid is None else float(np.nanmean(axis.grid.command * axis.grid.speed))
