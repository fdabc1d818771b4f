"""A column that is the motion itself, taken for the command.

A force acts on a velocity by way of an inertia, and a held command moves nothing before its stamp: what is in
proportion to the motion of the same instant, or of an earlier one, was computed from it.
"""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import PLAIN, Response, regress, responses

KIND = "copied_motion"
# Share of the power of the command that one signal of the motion and its slope explain.
_WHOLE = 0.999
# Time by which the motion lags the mean of a held command around it [samples]: of one that moves it 0 at least, of a
# copy -0.5, less where that is some samples late; to so many standard errors of at most this size.
_LAG, _EARLIEST, _ERRORS, _SURE = -0.25, -4.0, 3.0, 0.1


def check(axis: Axis) -> list[Finding]:
    """Look whether speed or position is the whole command, without a lag."""
    best: tuple[float, str, float, float, float] | None = None
    for one in (one for one in responses(axis) if one.functions.power == PLAIN):
        for signal, value, slope in _motions(one):
            gain, lag, error, share = _proportion(one, value, slope, axis.period)
            if share > _WHOLE and error < _SURE and _EARLIEST < lag < _LAG - _ERRORS * error:
                this = error, signal, gain, lag, share
                best = this if best is None else min(best, this)
    if best is None:
        return []
    error, signal, gain, lag, share = best
    name = axis.command_name
    return [
        fault(
            KIND,
            name,
            f"{name} is {gain:.4g} times the {signal} of {axis.joint} and a constant ({100.0 * share:.2f} % of its"
            f" power), and the motion does not lag it ({lag:.2f} ± {error:.2g} samples): it is a copy of the motion, no"
            " force or command that makes it",
            "give the column of the current, torque, voltage or duty cycle: `idloop start FILE --command COLUMN`",
            evidence={"gain": gain, "share": share, "lag": lag, signal: 1.0},
            spoils=("identification",),
        )
    ]


def _motions(one: Response) -> list[tuple[str, Array, Array]]:
    """Speed and position, each with its slope, over the test functions."""
    speed, place = one.others[:, 0], one.others[:, 3:]
    found = [("velocity", speed, one.acceleration)]
    return [*found, ("position", place[:, 0], speed)] if place.size else found


def _proportion(one: Response, value: Array, slope: Array, period: float) -> tuple[float, float, float, float]:
    """Factor of a signal in the command, lag with its error [samples], and the share that the signal explains."""
    command, value, slope = one.command[one.known], value[one.known], slope[one.known]
    constant = np.ones(command.size)
    (gain, late, _), errors, left = regress(command, np.column_stack([value, slope, constant]))
    if gain == 0.0:
        return 0.0, np.nan, np.inf, 0.0
    scale = abs(gain) * period
    return float(gain), float(late / (gain * period)), float(errors[1] / scale), 1.0 - left / float(np.var(command))
