"""Readings that say too little: a sensor that stands still, values that are sent again, coarse steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import around, fault
from idloop.records.inspection.motion import white_noise
from idloop.records.inspection.repeats import FASTER_LOG, FEWEST, SHARE, repeats, without_repeats

STUCK, COARSE = "stuck_sensor", "coarse"

# Shortest stretch of one value: samples, and how many times as long as all but the longest twentieth of such stretches.
_SAMPLES, _LONGER = 20, 5.0
# The speed that the other sensor shows there, as a share of its usual one, and in steps of the one that stands still.
_MOVING, _STEPS = 0.2, 20.0
_WALK = 5.0  # standard deviations of what its noise makes of it
_PARTS = 10  # of a stretch over which a slope is taken
# Without another sensor: the jump after a stretch in the largest of all other steps, and samples over which the axis
# moves by half of that beside it; share of the record that stretches take at most.
_LARGER, _BESIDE, _HALF = 5.0, 8, 0.5
_COARSE = 0.01  # steps of the range

Rows = tuple[int, int]


def stuck(axis: Axis) -> list[Finding]:
    """Look for stretches of one value of the position or the velocity while the axis moves.

    The other sensor shows that motion. Without one the position itself does, where it goes on with a jump: an axis that
    stood still begins to move slowly.
    """
    position, velocity, time = axis.place, axis.velocity, axis.time
    found: list[Finding] = []
    if position is None:
        return found
    for signal, value in axis.signals.items():
        name, unit, stretches = axis.name(signal), axis.unit(signal), _stretches(value)
        if velocity is None:
            rows = [one for one in stretches if _goes_on_with_a_jump(value, one, stretches)]
        else:
            moves = _travels if signal == "position" else _changes_place
            rows = [one for one in stretches if moves(time, position, velocity, slice(one[0], one[1] + 1))]
        if not rows:
            continue
        places = [(float(time[first]), float(time[last])) for first, last in rows]
        first, last = max(rows, key=lambda ends: ends[1] - ends[0])
        why = f"while {axis.name('velocity' if signal == 'position' else 'position')} moves"
        if velocity is None:
            why = f"and then jumps by {abs(value[last + 1] - value[last]):.3g} {unit}, which no axis does"
        found.append(
            fault(
                STUCK,
                name,
                f"{name} stays at exactly {value[first]:.6g} {unit} from {time[first]:.4g} to {time[last]:.4g} s"
                f" ({last - first + 1} samples) {why}: the sensor, or what reads it, stood still",
                "leave that time out (`rows:` in the mapping), or record again",
                evidence={"seconds": sum(b - a for a, b in places), "samples": sum(b - a + 1 for a, b in rows)},
                spoils=("identification",),
                places=places,
            )
        )
    return found


def _stretches(value: Array) -> list[Rows]:
    """First and last row of long stretches of one value; what lasts for nearly the whole record is no stretch."""
    ends = np.flatnonzero(np.concatenate([[True], value[1:] != value[:-1], [True]]))
    length = np.diff(ends)
    usual = float(np.quantile(length, 0.95))
    long = (length >= max(_SAMPLES, _LONGER * usual)) & (length < 0.9 * value.size)
    return [(int(ends[k]), int(ends[k + 1]) - 1) for k in np.flatnonzero(long) if np.isfinite(value[ends[k]])]


def _goes_on_with_a_jump(value: Array, rows: Rows, stretches: list[Rows]) -> bool:
    """Whether the value leaves a stretch by a jump out of all proportion to its other steps, and moves on."""
    step, ends = np.abs(np.diff(value)), np.array([last for _, last in stretches])
    others = np.delete(step, ends[ends < step.size])
    if rows[1] >= step.size - _BESIDE or sum(last - first for first, last in stretches) > _HALF * value.size:
        return False
    usual = float(np.nanmax(others))
    jump, after = step[rows[1]], abs(float(value[rows[1] + 1 + _BESIDE] - value[rows[1] + 1]))
    return bool(jump > max(_LARGER * usual, _LARGER * _step(value)) and after > _HALF * usual)


def _travels(time: Array, position: Array, velocity: Array, rows: slice) -> bool:
    """Whether the velocity shows a motion in a stretch of the position."""
    usual, interval = _size(velocity), np.diff(time[rows])
    gone = float(np.max(np.abs(np.nancumsum(velocity[rows][1:] * interval))))
    # The noise of a velocity adds up to a walk.
    walk = white_noise(velocity[np.isfinite(velocity)]) * float(np.sqrt(np.sum(interval**2)))
    # Of an axis that stands still a late velocity shows the motion before, and the position goes on without a jump.
    beyond = abs(float(np.sum(np.diff(position[rows.stop - 1 : rows.stop + 1]))))
    here = velocity[rows]
    late = _size(here[here.size // 2 :]) < _MOVING * usual and beyond < _HALF * gone
    return _size(here) > _MOVING * usual and gone > _STEPS * _step(position) + _WALK * walk and not late


def _changes_place(time: Array, position: Array, velocity: Array, rows: slice) -> bool:
    """Whether the position shows another motion in a stretch of the velocity."""
    within = time[rows]
    place = np.interp(np.linspace(within[0], within[-1], _PARTS + 1), within, position[rows])
    slope = np.diff(place) * _PARTS / (within[-1] - within[0])
    known = np.isfinite(position)
    usual = _size(np.gradient(position[known], time[known]))
    beside = float(np.sqrt(np.mean((slope - velocity[rows][0]) ** 2)))
    moved = float(np.ptp(position[rows])) > _STEPS * _step(position)
    return moved and beside > max(_MOVING * usual, 2.0 * _step(velocity))


def _size(value: Array) -> float:
    """Root mean square of the known values; 0 without any."""
    known = value[np.isfinite(value)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0


def _step(value: Array) -> float:
    """The smallest usual change between samples; 0 without any."""
    change = np.abs(np.diff(value))
    change = change[np.isfinite(change) & (change > 0.0)]
    return float(np.quantile(change, 0.01)) if change.size else 0.0


def repeated(axis: Axis) -> list[Finding]:
    """Count equal values with new stamps while the axis moves: the log is faster than the sensor, or one was resent."""
    found = []
    for name, value in axis.columns.items():
        known = np.flatnonzero(np.isfinite(value))
        rows, moving = repeats(value[known])
        share = rows.size / max(moving, 1)
        if rows.size < FEWEST or share < SHARE:
            continue
        why, cure = "the last value was sent again where none was read", "mark them as missing in the log"
        if share > FASTER_LOG:
            rate = 1.0 / axis.period
            sensor = f"the sensor at about {rate * max(1.0 - share, SHARE):.3g} Hz"
            why = f"the log runs at {rate:.4g} Hz, {sensor}; the repeats count as not measured"
            cure = "record at the rate of the sensor"
        found.append(
            fault(
                "repeated_samples",
                name,
                f"{name} repeats {rows.size} of {moving} values in motion ({100 * share:.2g} %) with new stamps: {why}",
                cure,
                evidence={"share": share, "repeats": rows.size},
                spoils=("delays",) if share > FASTER_LOG else (),
                places=around(axis.time, known[rows + 1]),
            )
        )
    return found


def fresh(axis: Axis) -> Axis:
    """Return the axis with NaN where a log that is faster than its sensor repeats a value."""
    position, velocity = (None if one is None else without_repeats(one) for one in (axis.position, axis.velocity))
    return replace(axis, position=position, velocity=velocity)


def coarse(axis: Axis) -> list[Finding]:
    """Name the sensors whose steps are a large part of the range of their signal."""
    found = []
    for signal, value in axis.signals.items():
        step, span = axis.resolution[signal], _span(value, signal)
        if not step > _COARSE * span:
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
    return fault.evidence["step"] > _COARSE * _span(value, fault.where.rpartition(".")[2])


def _span(value: Array, signal: str) -> float:
    """Range of values (n,); a steady speed is a motion as well."""
    ends = [float(np.nanmin(value)), float(np.nanmax(value))]
    return float(np.ptp([*ends, 0.0] if signal == "velocity" else ends))
