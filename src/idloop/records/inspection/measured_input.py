"""A command that acts before its stamp: not held from there on, but measured as it went.

A held command moves the axis from its stamp on: what changes the velocity around an instant are commands stamped half a
sample before, on average. What changes it along with a measured current, torque or command read back are values stamped
around the same instant. The stamps' weights in a regression of the acceleration tell the two apart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.records.finding import Finding

Floats = NDArray[np.float64]

KIND = "measured_input"

# Where the command acts is told to this part of a sample, by four standard errors; a held one acts 0.5 samples late.
_TOLD, _ERRORS = 0.25, 4.0
# The command explains at least this part of the acceleration's power, or nothing is said.
_EXPLAINED = 0.5
# Rates of command and measurement that count as one.
_SAME_RATE = 0.05
_FEWEST = 100


def acts_late(input_time: Floats, command: Floats, time: Floats, motion: Floats, order: int) -> tuple[float, float]:
    """How long after its stamp a command acts on average, and the standard error of that [samples].

    Parameters
    ----------
    input_time, command : array, shape (m,)
        Stamps [s] and values.
    time, motion : array, shape (n,)
        Stamps [s] and a position or a velocity.
    order : int
        Differences from the motion to the acceleration: 2 of a position, 1 of a velocity.

    Returns
    -------
    late, error : float
        NaN where nothing can be told: other rates, uneven stamps, an acceleration that the command does not explain.
    """
    untold = (float("nan"), float("nan"))
    input_time, command = (values[np.isfinite(command)] for values in (input_time, command))
    time, motion = (values[np.isfinite(motion)] for values in (time, motion))
    if len(time) < _FEWEST or len(command) < _FEWEST:
        return untold
    step = float(np.median(np.diff(time)))
    if abs(float(np.median(np.diff(input_time))) / step - 1.0) > _SAME_RATE:
        return untold
    # The stamp of every sample's command, and what it is then: the last that was given.
    place = np.searchsorted(input_time, time + 1e-3 * step, side="right") - 1
    known = place >= 2
    acceleration = np.full(len(time), np.nan)
    if order == 2:
        acceleration[1:-1] = np.diff(motion, 2)
        middle, speed = time, np.gradient(motion)
    else:
        acceleration[:-1] = np.diff(motion)
        middle, speed = time + 0.5 * step, motion
    steady = np.zeros(len(time), dtype=bool)
    steady[1:-1] = (np.abs(np.diff(time)[1:] / step - 1.0) < 0.1) & (np.abs(np.diff(time)[:-1] / step - 1.0) < 0.1)
    rows = np.flatnonzero(known & steady & (place + 2 < len(command)))
    if len(rows) < _FEWEST:
        return untold
    offsets = [-1, 0, 1] if order == 2 else [-1, 0, 1, 2]
    columns = [command[place[rows] + offset] for offset in offsets]
    after = np.array([np.mean(input_time[place[rows] + offset] - middle[rows]) for offset in offsets]) / step
    rest = 0.02 * np.std(speed)
    # A spring, and what slows down.
    other = [
        *([motion[rows]] if order == 2 else []),
        speed[rows],
        np.tanh(speed[rows] / max(rest, 1e-300)),
        np.ones(len(rows)),
    ]
    table = np.column_stack([*columns, *other])
    target = acceleration[rows]
    size = np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    inverse = np.linalg.pinv(table / size, rcond=1e-12)
    found = (inverse @ target) / size
    left = target - table @ found
    without = np.column_stack(other)
    alone = target - without @ np.linalg.lstsq(without, target, rcond=None)[0]
    if np.sum(left**2) > (1.0 - _EXPLAINED) * np.sum(alone**2):
        return untold
    count = len(offsets)
    spread = (inverse @ inverse.T)[:count, :count] / np.outer(size[:count], size[:count])
    covariance = spread * float(left @ left) / max(len(rows) - table.shape[1], 1)
    weights = found[:count]
    total = float(np.sum(weights))
    if total == 0.0:
        return untold
    late = -float(weights @ after) / total
    slope = (-after - late) / total
    return late, float(np.sqrt(max(slope @ covariance @ slope, 0.0)))


def measured_input(
    name: str, input_time: Floats, command: Floats, time: Floats, motions: dict[str, Floats]
) -> list[Finding]:
    """Say that a command was measured and is not held, where the motion shows it.

    Parameters
    ----------
    name : str
        Of the command.
    input_time, command : array, shape (m,)
    time : array, shape (n,)
    motions : dict of str to array (n,)
        Positions and velocities by ``joint.field``.

    Returns
    -------
    list of Finding
        One or none.
    """
    for output, motion in motions.items():
        order = {"position": 2, "velocity": 1}.get(output.rpartition(".")[2])
        if order is None:
            continue
        late, error = acts_late(input_time, command, time, motion, order)
        if abs(late) + _ERRORS * error < _TOLD:
            text = (
                f"{name} acts around its stamps ({round(late, 2) + 0.0:g} ± {error:.2g} samples late by {output}), not"
                " from them on: it was measured, as a current, a torque or a command read back is; say"
                " `input: {kind: measured}`"
            )
            return [Finding(KIND, text, where=name, level="warning")]
    return []
