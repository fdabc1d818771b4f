"""Commands that were measured, such as a current, and so act around their stamps instead of from them on.

A held command moves the axis from its stamp on: changes of the velocity around an instant are due to commands stamped
half a sample before, on average. For a measured current or torque, or a command read back, they are due to values
stamped around the same instant. The weights of the stamps in a regression of the acceleration separate the two.
"""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding

KIND = "measured_input"

# A measured command acts within this part of a sample, four standard errors included; a held one 0.5 samples late.
_AT_ONCE, _ERRORS = 0.25, 4.0
_EXPLAINED = 0.8  # share of the power of the acceleration that the command must explain for a decision
# Rates of command and measurement that count as one.
_SAME_RATE = 0.05
_FEWEST, _MOST = 100, 50_000


def acts_late(input_time: Array, command: Array, time: Array, motion: Array, order: int) -> tuple[float, float]:
    """Return how long after its stamp a command acts on average, and the standard error [samples].

    `input_time`, `command` (m,): stamps [s] and values.
    `time`, `motion` (n,): stamps [s] and a position or a velocity.
    `order`: differences from the motion to the acceleration: 2 of a position, 1 of a velocity.
    Returns `late`, `error`: NaN where there is no decision: other rates, uneven stamps, an acceleration that the
    command does not explain.
    """
    undecided = (float("nan"), float("nan"))
    input_time, command = (values[np.isfinite(command)] for values in (input_time, command))
    time, motion = (values[np.isfinite(motion)] for values in (time, motion))
    if len(time) < _FEWEST or len(command) < _FEWEST:
        return undecided
    step = float(np.median(np.diff(time)))
    if abs(float(np.median(np.diff(input_time))) / step - 1.0) > _SAME_RATE:
        return undecided
    # Index of the last command at every sample.
    place = np.searchsorted(input_time, time + 1e-3 * step, side="right") - 1
    acceleration = np.full(len(time), np.nan)
    if order == 2:
        acceleration[1:-1] = np.diff(motion, 2)
        middle, speed, offsets = time, np.gradient(motion), [-1, 0, 1]
    else:
        acceleration[:-1] = np.diff(motion)
        middle, speed, offsets = time + 0.5 * step, motion, [-1, 0, 1, 2]
    even = np.abs(np.diff(time) / step - 1.0) < 0.1
    steady = np.concatenate([[False], even[1:] & even[:-1], [False]])
    rows = np.flatnonzero((place >= 2) & steady & (place + 2 < len(command)))
    if len(rows) > _MOST:
        # By chance: with even steps a command that is held over many samples would never be seen to change.
        rows = np.sort(np.random.default_rng(0).choice(rows, _MOST, replace=False))
    if len(rows) < _FEWEST:
        return undecided
    count = len(offsets)
    columns = [command[place[rows] + offset] for offset in offsets]
    after = np.array([np.mean(input_time[place[rows] + offset] - middle[rows]) for offset in offsets]) / step
    if np.linalg.matrix_rank(np.column_stack(columns)) < count:
        return undecided
    # A spring, friction and a constant force.
    friction = np.tanh(speed[rows] / max(0.02 * np.std(speed), 1e-300))
    others = np.column_stack([speed[rows], friction, np.ones(len(rows)), *([motion[rows]] if order == 2 else [])])
    table, target = np.column_stack([*columns, others]), acceleration[rows]
    size = np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    inverse = np.linalg.pinv(table / size, rcond=1e-12)
    weights = (inverse @ target) / size
    left = target - table @ weights
    alone = target - others @ np.linalg.lstsq(others, target, rcond=None)[0]
    total = float(np.sum(weights[:count]))
    if np.sum(left**2) > (1.0 - _EXPLAINED) * np.sum(alone**2) or total == 0.0:
        return undecided
    late = -float(weights[:count] @ after) / total
    slope = (-after - late) / (total * size[:count])
    variance = float(np.sum((inverse[:count].T @ slope) ** 2)) * float(left @ left)
    return late, float(np.sqrt(variance / max(len(rows) - table.shape[1], 1)))


def decided(
    input_time: Array, command: Array, time: Array, motions: dict[str, Array]
) -> dict[str, tuple[float, float]]:
    """Return how late a command acts and its error [samples] by the outputs that show it; arrays as of `acts_late`.

    `motions` are positions and velocities (n,) by ``joint.field``.
    """
    orders = {output: {"position": 2, "velocity": 1}.get(output.rpartition(".")[2]) for output in motions}
    found = {
        output: acts_late(input_time, command, time, motions[output], order)
        for output, order in orders.items()
        if order is not None
    }
    return {output: one for output, one in found.items() if np.isfinite(one).all()}


def all_near(shown: dict[str, tuple[float, float]], late: float) -> bool:
    """Whether a command acts so late by each output that shows it; the noise of a velocity in a loop looks alike."""
    return bool(shown) and all(abs(one - late) + _ERRORS * error < _AT_ONCE for one, error in shown.values())


def measured_input(
    name: str, input_time: Array, command: Array, time: Array, motions: dict[str, Array]
) -> list[Finding]:
    """Return a finding where the motion shows that a command was measured and is not held; arrays as of `decided`."""
    shown = decided(input_time, command, time, motions)
    if not all_near(shown, 0.0):
        return []
    output, (late, error) = min(shown.items(), key=lambda one: one[1][1])
    cure = "set `input: {kind: measured}` in the model file"
    text = (
        f"{name} acts around its stamps ({round(late, 2) + 0.0:g} ± {error:.2g} samples late by {output}), not from"
        f" them on: it was measured, like a current, a torque or a command read back; {cure}"
    )
    evidence = {"late": late, "error": error}
    return [Finding(KIND, text, where=name, level="warning", evidence=evidence, cure=cure)]
