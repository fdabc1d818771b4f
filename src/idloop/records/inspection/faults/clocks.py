"""Command and measurement stamped by two clocks, or one of them by simulated time.

Stamps of two streams are compared at equal times of receipt, and by the motion: it never precedes the command, and
follows it as late at the end of a record as at its beginning.
"""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.clocks import clock_finding
from idloop.records.inspection.faults.fault import LATE, fault, late_option
from idloop.records.inspection.time_axes import TimeAxes, time_axes

OFFSET = "clock_offset"
# Share of the acceleration that is explained with other times of the command, and of the rest that they leave.
_EXPLAINED, _LEFT = 0.6, 0.5
# Samples, and seconds, of a difference of two times that counts; a measured command is smoothed, and so late by itself.
_SAMPLES, _EARLY, _EARLY_ALONE = 3.0, 0.005, 0.02


def check(axis: Axis) -> list[Finding]:
    """Compare the stamps of both streams at equal receive times, and the times of the command with the motion."""
    if axis.command_stream is None or axis.measured_stream is None:
        return []
    found = clock_finding(axis.command_stream, axis.measured_stream)
    if found is not None:
        return [found]
    return [] if _one_clock(axis) else _by_motion(axis)


def _one_clock(axis: Axis) -> bool:
    """Whether both were stamped together, row by row, in one file."""
    few, many = sorted((axis.input_time, axis.time), key=len)
    return not axis.joined and bool(np.isin(few, many).all())


def _by_motion(axis: Axis) -> list[Finding]:
    found = time_axes(axis)
    if found is None or found.share < _EXPLAINED:
        return []
    drift = abs(found.stretch - 1.0) * found.duration
    if drift > _SAMPLES * axis.period and 1.0 - found.share < _LEFT * (1.0 - found.without_stretch):
        faster = 1e2 * (1.0 / found.stretch - 1.0)
        what = (
            f"two clocks: the times of {axis.command_name} and of the motion drift apart by {1e3 * drift:.3g} ms over"
            f" {found.duration:.3g} s, the clock of the command runs {abs(faster):.2g} %"
            f" {'fast' if faster > 0.0 else 'slow'}"
        )
        return [_fault(axis, found, what)]
    least = max(_SAMPLES * axis.period, _EARLY if axis.joined else _EARLY_ALONE)
    if -found.offset > least and 1.0 - found.share < _LEFT * (1.0 - found.causal):
        what = f"two clocks: the motion precedes {axis.command_name} by {-1e3 * found.offset:.3g} ms"
        return [_fault(axis, TimeAxes(**{**vars(found), "stretch": 1.0}), what)]
    if axis.joined and found.offset > least:
        what = (
            f"the motion follows {axis.command_name} {1e3 * found.offset:.3g} ms late: the times of the files do not"
            " begin together, or the drive has such a delay"
        )
        return [_fault(axis, TimeAxes(**{**vars(found), "stretch": 1.0}), what)]
    return []


def _fault(axis: Axis, found: TimeAxes, what: str) -> Finding:
    keys = [f"stretch: {found.stretch:.6g}"] if found.stretch != 1.0 else []
    keys += [f"offset: {found.offset:.5g}"] if abs(found.offset) > 0.5 * axis.period or not keys else []
    certain = what.startswith("two clocks")
    shifted = found.stretch == 1.0
    cure = f"correct the times of the command in the mapping: `time: {{..., {', '.join(keys)}}}`"
    cure += f", as {late_option(-found.offset)} does" if shifted else ""
    return fault(
        "two_clocks" if certain else OFFSET,
        axis.command_name,
        f"{what}; with times corrected for that, {100 * found.share:.0f} % of the acceleration follow the command, as"
        f" they are {100 * max(found.causal, 0.0):.0f} %",
        f"record both with one clock, or {cure}",
        evidence={"offset": found.offset, "stretch": found.stretch, "share": found.share, "causal": found.causal}
        # What may be a delay of the drive is no fault of the stamps.
        | ({LATE: -found.offset} if shifted and certain else {}),
        spoils=("identification",) if certain else ("delays",),
    )
