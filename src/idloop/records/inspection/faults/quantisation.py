"""A sensor whose steps are a large part of the motion."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault

COARSE = "coarse"
_SHARE = 0.01  # steps of the range


def check(axis: Axis) -> list[Finding]:
    """Compare the step of position and velocity with their range."""
    found = []
    for signal, value in (("position", axis.place), ("velocity", axis.velocity)):
        if value is None:
            continue
        step, span = axis.resolution[signal], _span(value, signal)
        if not step > _SHARE * span:
            continue
        name, unit = axis.name(signal), axis.unit(signal)
        found.append(
            fault(
                COARSE,
                name,
                f"{name} is coarse, steps of {step:.3g} {unit} over a range of {span:.3g} {unit}"
                f" ({100 * step / span:.2g} %): quantisation is a large part of its noise",
                "move further, or use a finer sensor; a fit counts the step as noise",
                evidence={"step": step, "range": span},
                spoils=("friction at low speed", "play") if signal == "position" else (),
            )
        )
    return found


def is_coarse(fault: Finding, value: Array) -> bool:
    """Whether the steps of a coarse signal are a large part of the range of further values (n,) of it as well."""
    return fault.evidence["step"] > _SHARE * _span(value, fault.where.rpartition(".")[2])


def _span(value: Array, signal: str) -> float:
    """Range of values (n,); a steady speed is a motion as well."""
    ends = [float(np.nanmin(value)), float(np.nanmax(value))]
    return float(np.ptp([*ends, 0.0] if signal == "velocity" else ends))
