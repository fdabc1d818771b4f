"""Loops around an axis: a set-point taken for the command, a copy of the motion, a reference that is not on record."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Mask
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import Response, own_share, plain_responses, regress
from idloop.records.tables.base_units import base_unit
from idloop.spelling import joined_names

SET_POINT, COPY = "inner_loop", "copied_motion"

_GAIN, _FOLLOWS = 0.03, 0.97  # the motion follows a set-point with this gain, and this share of its power
# Units of set-points.
_POSITION = ("rad", "deg", "rev", "m", "mm", "cm", "counts")
_VELOCITY = ("rad/s", "rpm", "deg/s", "rev/s", "m/s", "mm/s")
_NO_FORCE = ("", "-")
# Units in which a set-point may be that has none, by the unit of the motion.
_USUAL = {
    "rad": ("rad", "deg", "rev"), "m": ("m", "mm"), "rad/s": ("rad/s", "rpm", "deg/s"), "m/s": ("m/s", "mm/s"),
}  # fmt: skip
_LAGS, _ENOUGH = 24, 60  # delays, and samples that they leave
# In the balance of a position loop the position has this factor, to this accuracy, explains this share of the command
# beside what moves the axis, and leaves so little of it.
_FACTOR, _EXACT, _OWN, _WHOLE = 0.02, 0.01, 0.9, 0.98
_WITH_POSITION = 4  # columns beside the command: speed, its sign, constant, position

_COPIED = 0.999  # of a copy: share of the power of the command that one signal of the motion and its slope explain
# Time by which the motion lags the mean of a held command around it [samples]: of one that moves it 0 at least, of a
# copy -0.5, less where that is some samples late; to so many standard errors of at most this size.
_LAG, _EARLIEST, _ERRORS, _SURE = -0.25, -4.0, 3.0, 0.1

# Past commands (enough for a sum of eight sines, which follows from its past), older measurements, and newest
# measurements of the regression; samples used.
_PAST, _OLD, _NEW, _MOST, _FEWEST = 16, 6, 4, 20_000, 300
# Share of what is new in the command that the newest measurements explain, without the largest errors: those are steps
# of a reference.
_SHARE, _STEPS = 0.25, 0.1
_SAME_RATE = 0.1
_LOST = 1.5  # an interval of so many periods has lost a sample
# Share of the samples at which the command changes; and of its changes that are rounding.
_CHANGES, _ROUNDING = 0.2, 1e-9
# A step of the command, in medians of its changes; and share of the rows without one that are enough.
_STEP, _PLAIN = 12.0, 0.75
_PARTS = 8  # parts of the rows, each predicted from the others


def set_point(axis: Axis) -> Finding | None:
    """A loop in the drive: the command is a set-point that position or velocity follow, no force."""
    grid, name = axis.grid, axis.command_name
    if not axis.command.size or grid is None:
        return None
    unit, field = axis.units.get(name, ""), name.rpartition(".")[2]
    found: list[tuple[str, str, float, float]] = []
    for signal, value in (("position", grid.position), ("velocity", grid.speed)):
        # A force may give a speed of the same number; a force that gives a position of it is a set-point.
        if signal == "velocity" and unit not in (*_NO_FORCE, *_VELOCITY):
            continue
        gain, share = _follows(grid.command, value)
        found += [
            (signal, own, gain / factor, share)
            for own, factor in _units(axis, signal, unit)
            if abs(gain / factor - 1.0) < _GAIN and share > _FOLLOWS
        ]
    loop = None if found or unit not in _NO_FORCE else _position_loop(axis, _units(axis, "position", unit))
    by_unit = "position" if unit in _POSITION else "velocity" if unit in _VELOCITY else ""
    by_field = field if field in ("position", "velocity") and not unit else ""
    if not (found or loop or by_unit or by_field):
        return None
    if loop is not None:
        found = [("position", *loop)]
    signal, taken, gain, share = found[0] if found else (by_unit or by_field, unit, np.nan, np.nan)
    read = f", read in {taken}," if found and unit in _NO_FORCE else ""
    if loop:
        beside = f"beside speed, friction and acceleration {axis.name(signal)} is in it{read} with a factor"
        why = f"{beside} of {gain:.3f}, as in a loop ({100 * share:.1f} % of its power)"
    elif found:
        why = f"{axis.name(signal)} follows it{read} with a gain of {gain:.3f} ({100 * share:.1f} % of its power)"
    else:
        why = f"it is given in {unit}" if by_unit else f"it is sent as a {field}"
    return fault(
        SET_POINT,
        name,
        f"{name} is a set-point of the {signal}: {why}; a controller inside the drive makes the force",
        "record the current or the torque of the drive as the command, or model the loop of the drive: "
        f"`drive: {{kind: {signal}_loop}}`",
        evidence={"gain": gain, "share": share, taken: 1.0} if found else {},
        spoils=("inertia and friction",),
    )


def unit_of_set_point(finding: Finding) -> str:
    """Return the unit in which the motion follows the command one to one; empty where a finding says none."""
    usual = [unit for units in _USUAL.values() for unit in units]
    return next((unit for unit in usual if finding.kind == SET_POINT and unit in finding.evidence), "")


def _units(axis: Axis, signal: str, unit: str) -> list[tuple[str, float]]:
    """Units in which a command may be a set-point of a signal, with their factors to that of the signal."""
    own = axis.unit(signal)
    names = _USUAL.get(own, (own,)) if unit in _NO_FORCE else (own,)
    return [(name, base_unit(name, signal, "")[1] if name != own else 1.0) for name in names]


def _follows(command: Array, value: Array) -> tuple[float, float]:
    """Gain and share of the power with which a signal follows the command some samples later, by the best delay."""
    best = (0.0, 0.0)
    for lag in range(_LAGS):
        u, y = command[: command.size - lag], value[lag:]
        known = np.isfinite(u) & np.isfinite(y)
        if known.sum() < _ENOUGH:
            continue
        u, y = u[known] - np.mean(u[known]), y[known] - np.mean(y[known])
        power, both, motion = float(u @ u), float(u @ y), float(y @ y)
        if power > 0.0 and motion > 0.0 and both**2 / (power * motion) > best[1]:
            best = (both / power, both**2 / (power * motion))
    return best


def _position_loop(axis: Axis, units: list[tuple[str, float]]) -> tuple[str, float, float] | None:
    """Unit of the command, factor of the position in it, and the share that its balance explains, of a loop.

    A controller whose force is ``stiffness (command - position) - damping speed`` makes the command the position plus
    what is proportional to speed, friction and acceleration, however softly the motion follows it. The command of a
    force holds no position, or as much of it as there is of a spring.
    """
    found = []
    for one in plain_responses(axis):
        if one.others.shape[1] < _WITH_POSITION:
            continue
        command = one.command[one.known]
        speed, friction, constant, place = one.others[one.known][:, :_WITH_POSITION].T
        table = np.column_stack([place, speed, friction, one.acceleration[one.known], constant])
        (factor, *_), (error, *_), left = regress(command, table)
        power = float(np.var(command))
        share, own = 1.0 - left / power if power > 0.0 else 0.0, own_share(command, table, left)
        if own > _OWN and share > _WHOLE:
            found += [(times * error, name, float(times * factor), share) for name, times in units]
    sure = [one for one in found if one[0] < _EXACT and abs(one[2] - 1.0) < _FACTOR]
    return min(sure)[1:] if sure else None


def copied_motion(axis: Axis) -> Finding | None:
    """A column that is the motion itself, taken for the command: speed or position is all of it, without a lag.

    A force acts on a velocity by way of an inertia, and a held command moves nothing before its stamp: what is in
    proportion to the motion of the same instant, or of an earlier one, was computed from it.
    """
    found = []
    for one in plain_responses(axis):
        speed, place = one.others[:, 0], one.others[:, 3:]
        motions = [("velocity", speed, one.acceleration)]
        motions += [("position", place[:, 0], speed)] if place.size else []
        for signal, value, slope in motions:
            gain, lag, error, share = _proportion(one, value, slope, axis.period)
            if share > _COPIED and error < _SURE and _EARLIEST < lag < _LAG - _ERRORS * error:
                found.append((error, signal, gain, lag, share))
    if not found:
        return None
    error, signal, gain, lag, share = min(found)
    name = axis.command_name
    return fault(
        COPY,
        name,
        f"{name} is {gain:.4g} times the {signal} of {axis.joint} and a constant ({100.0 * share:.2f} % of its power),"
        f" and the motion does not lag it ({lag:.2f} ± {error:.2g} samples): it is a copy of the motion, no force or"
        " command that makes it",
        "give the column of the current, torque, voltage or duty cycle: `idloop start FILE --command COLUMN`",
        evidence={"gain": gain, "share": share, "lag": lag, signal: 1.0},
        spoils=("identification",),
    )


def _proportion(one: Response, value: Array, slope: Array, period: float) -> tuple[float, float, float, float]:
    """Factor of a signal in the command, lag with its error [samples], and the share that the signal explains."""
    command, value, slope = one.command[one.known], value[one.known], slope[one.known]
    table = np.column_stack([value, slope, np.ones(command.size)])
    (gain, late, _), errors, left = regress(command, table)
    if gain == 0.0:
        return 0.0, np.nan, np.inf, 0.0
    scale = gain * period
    return float(gain), float(late / scale), float(errors[1] / abs(scale)), 1.0 - left / float(np.var(command))


def feedback(axis: Axis) -> Finding | None:
    """A loop that was closed without its reference on record: the command answers to the newest motion.

    What is new in a measurement, its noise and its steps, was not known to any command before. Where it shows in the
    next command, the command was computed from it.
    """
    if axis.has_reference or axis.command.size < _FEWEST or axis.time.size < _FEWEST:
        return None
    if abs(float(np.median(np.diff(axis.input_time))) / axis.period - 1.0) > _SAME_RATE:
        return None
    share = _explained(axis, list(axis.signals.values()))
    if share < _SHARE:
        return None
    name = axis.command_name
    return fault(
        "unrecorded_reference",
        name,
        f"{name} answers to the newest {joined_names(list(axis.motions))} ({100 * share:.0f} % of what is new in it): a"
        " loop was closed, and its reference is not on record",
        "record the reference (topic `reference`, `reference:` in the mapping), and judge a model by the command",
        evidence={"share": share},
        spoils=("open-loop black-box models",),
    )


def _explained(axis: Axis, signals: list[Array]) -> float:
    """Share of a command, beyond those before it, that the newest measurements explain.

    From command to command, so that a log of two clocks repeats and leaves out measurements and no commands: those
    before an even sine tell where it goes on.
    """
    newest = np.searchsorted(axis.time, axis.input_time + 1e-3 * axis.period, side="right") - 1
    measured = [one[np.maximum(newest, 0)] for one in signals]
    good = (newest >= 0) & np.isfinite(axis.command) & np.isfinite(measured).all(axis=0)
    # What is new is the step of one sample: no row may reach over a missing one.
    lost = np.append(0, np.cumsum(np.diff(axis.time) > _LOST * axis.period))[np.maximum(newest, 0)]
    steps = np.diff(axis.input_time)
    good &= np.append(True, (np.diff(lost) == 0) & (steps < _LOST * float(np.median(steps))))
    # Differences: no offset, no drift, and no large common part.
    command, whole = np.diff(axis.command[-_MOST:]), good[-_MOST:]
    motions = [np.diff(one[-_MOST:]) for one in measured]
    last = max(_PAST, _OLD + _NEW - 1)
    rows = last + np.flatnonzero(np.lib.stride_tricks.sliding_window_view(whole, last + 2).all(axis=1))
    if rows.size < _FEWEST:
        return 0.0
    # Behind a step its past says less than the motion, which follows the command and not the noise of its reading.
    size = np.abs(command)
    step = size > _STEP * float(np.median(size[size > 0.0])) if (size > 0.0).any() else size > 0.0
    steps_before = np.append(0, np.cumsum(step))
    plain = rows[steps_before[rows] == steps_before[rows - _PAST]]
    rows = plain if plain.size > _PLAIN * rows.size else rows
    # Where the command is held over many samples, only its changes may answer to anything.
    target = command[rows]
    if np.mean(target != 0.0) < _CHANGES or not all(np.any(one) for one in motions):
        return 0.0
    # A steady ramp of the command follows from its past: that is the constant.
    known = np.column_stack(
        [np.ones(rows.size)]
        + [command[rows - k] for k in range(1, _PAST + 1)]
        + [one[rows - k] for one in motions for k in range(_NEW, _OLD + _NEW)]
    )
    new = np.column_stack([one[rows - k] for one in motions for k in range(_NEW)])
    before, after_new = _power(known, target), _power(np.hstack([known, new]), target)
    floor = (_ROUNDING * float(np.sqrt(np.mean(target**2)))) ** 2
    return 1.0 - after_new / before if before > floor else 0.0


def _power(table: Array, target: Array) -> float:
    """Mean square error, without the largest errors, of predictions of each part of the rows from the other parts.

    More columns fit more of the rows that they are fitted to; rows that they are not fitted to they predict better
    only where they tell something.
    """
    errors = np.empty(target.size)
    for part in np.array_split(np.arange(target.size), _PARTS):
        keep = np.ones(target.size, dtype=bool)
        keep[part] = False
        others = np.flatnonzero(keep)
        for _ in range(2):
            left = _left(table, target, keep)
            size = np.abs(left[others])
            keep[others] = size <= np.quantile(size, 1.0 - _STEPS)
        errors[part] = left[part] ** 2
    return float(np.mean(np.sort(errors)[: max(int(errors.size * (1.0 - _STEPS)), 1)]))


def _left(table: Array, target: Array, keep: Mask) -> Array:
    size = np.maximum(np.sqrt(np.mean(table**2, axis=0)), 1e-300)
    weights = np.linalg.lstsq(table[keep] / size, target[keep], rcond=1e-12)[0]
    return np.asarray(target - (table / size) @ weights)
