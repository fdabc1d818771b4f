"""Records of one axis, judged together: what one of them does not excite another does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.excitation import SLOW, SMALL, STILL, TWO_LEVELS, is_slow
from idloop.records.inspection.faults.quantisation import COARSE, is_coarse
from idloop.records.inspection.inspection import Inspection
from idloop.records.inspection.response import response


def judged_together(inspections: Sequence[Inspection]) -> tuple[Inspection, ...]:
    """Return the inspections of one set, where faults of an excitation that the set has not are notes.

    The levels of a command add up, as the range of a coarse sensor does, and an inertia that a slow record does not
    show is known from one that does.
    """
    if len(inspections) < 2:
        return tuple(inspections)
    axes: dict[str, list[tuple[Axis, Inspection]]] = {}
    for one in inspections:
        for axis in one.axes:
            axes.setdefault(axis.joint, []).append((axis, one))
    return tuple(_judged(one, axes) for one in inspections)


def _judged(inspection: Inspection, axes: dict[str, list[tuple[Axis, Inspection]]]) -> Inspection:
    kinds = {one.kind for one in inspection.faults} & {TWO_LEVELS, SLOW, COARSE}
    shown = {
        kind
        for kind in kinds
        if all(
            any(_is_shown(one, axes[axis.joint]) for axis in inspection.axes if one.where.startswith(f"{axis.joint}."))
            for one in inspection.faults
            if one.kind == kind
        )
    }
    return inspection.with_notes(*shown) if shown else inspection


def _is_shown(fault: Finding, axes: Sequence[tuple[Axis, Inspection]]) -> bool:
    """Whether records of a joint together have not the fault that one of them has."""
    if fault.kind == TWO_LEVELS:
        levels = [np.unique(axis.command[np.isfinite(axis.command)])[:3] for axis, _ in axes]
        return np.unique(np.concatenate(levels)).size > 2
    if fault.kind == SLOW:
        return is_slow(fault) and any(_shows_inertia(axis, one) for axis, one in axes)
    values = [value for axis, _ in axes if (value := axis.motions.get(fault.where)) is not None]
    return bool(values) and not is_coarse(fault, np.concatenate(values))


def _shows_inertia(axis: Axis, inspection: Inspection) -> bool:
    """Whether nothing was found that hides the inertia."""
    hidden = any(
        one.kind in (SLOW, SMALL, STILL) and one.where.partition(".")[0] == axis.joint for one in inspection.faults
    )
    return not hidden and response(axis) is not None
