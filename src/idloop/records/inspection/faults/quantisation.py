"""A sensor whose steps are a large part of the motion."""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault

# Steps as a share of the range.
_COARSE = 0.01


def check(axis: Axis) -> list[Finding]:
    """Compare the step of position and velocity with their range."""
    found = []
    for signal, value in (("position", axis.place), ("velocity", axis.velocity)):
        if value is None:
            continue
        ends = [float(np.nanmin(value)), float(np.nanmax(value))]
        # A steady speed is a motion as well.
        step, span = axis.resolution[signal], float(np.ptp([*ends, 0.0] if signal == "velocity" else ends))
        if not step > _COARSE * span:
            continue
        name, unit = axis.name(signal), axis.unit(signal)
        found.append(
            fault(
                "coarse",
                name,
                f"{name} is coarse, steps of {step:.3g} {unit} over a range of {span:.3g} {unit}"
                f" ({100 * step / span:.2g} %): quantisation is a large part of its noise",
                "move further, or use a finer sensor; a fit counts the step as noise",
                evidence={"step": step, "range": span},
                spoils=("friction at low speed", "play") if signal == "position" else (),
            )
        )
    return found
