"""A sensor that stands still for a while: its value stays exactly equal while the axis moves.

The other sensor shows that motion. Without one the position itself does, where it goes on with a jump: an axis that
stood still begins to move slowly.
"""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.motion import white_noise

KIND = "stuck_sensor"

# Shortest stretch of one value: samples, and how many times as long as all but the longest twentieth of such stretches.
_SAMPLES, _LONGER = 20, 5.0
# The speed that the other sensor shows there, as a share of its usual one, and in steps of the one that stands still.
_MOVING, _STEPS = 0.2, 20.0
_WALK = 5.0  # standard deviations of what its noise makes of it
# Parts of a stretch over which a slope is taken.
_PARTS = 10
# Without another sensor: the jump after a stretch in the largest of all other steps, and samples over which the axis
# moves by half of that beside it; share of the record that stretches take at most.
_LARGER, _BESIDE, _HALF = 5.0, 8, 0.5


def check(axis: Axis) -> list[Finding]:
    """Look for stretches of one value of the position or the velocity while the other one moves."""
    position, velocity, time = axis.place, axis.velocity, axis.time
    found = []
    for signal, value in (("position", position), ("velocity", velocity)):
        if value is None or position is None:
            continue
        stretches = _stretches(value)
        if velocity is None:
            rows = [rows for rows in stretches if _goes_on_with_a_jump(value, rows, stretches)]
        else:
            rows = [
                (first, last)
                for first, last in stretches
                if _moves(signal, time, position, velocity, slice(first, last + 1))
            ]
        if not rows:
            continue
        seconds = sum(float(time[last] - time[first]) for first, last in rows)
        first, last = max(rows, key=lambda ends: ends[1] - ends[0])
        if velocity is None:
            why = f"and then jumps by {abs(value[last + 1] - value[last]):.3g} {axis.unit(signal)}, which no axis does"
        else:
            why = f"while {axis.name('velocity' if signal == 'position' else 'position')} moves"
        found.append(
            fault(
                KIND,
                axis.name(signal),
                f"{axis.name(signal)} stays at exactly {value[first]:.6g} {axis.unit(signal)} from {time[first]:.4g} to"
                f" {time[last]:.4g} s ({last - first + 1} samples) {why}: the sensor, or what reads it, stood still",
                "leave that time out (`rows:` in the mapping), or record again",
                evidence={"seconds": seconds, "samples": float(sum(b - a + 1 for a, b in rows))},
                spoils=("identification",),
                count=len(rows),
                places=[(float(time[a]), float(time[b])) for a, b in rows],
            )
        )
    return found


def _stretches(value: Array) -> list[tuple[int, int]]:
    """First and last row of long stretches of one value; what lasts for nearly the whole record is no stretch."""
    ends = np.flatnonzero(np.concatenate([[True], value[1:] != value[:-1], [True]]))
    length = np.diff(ends)
    usual = float(np.quantile(length, 0.95))
    long = (length >= max(_SAMPLES, _LONGER * usual)) & (length < 0.9 * value.size)
    return [(int(ends[k]), int(ends[k + 1]) - 1) for k in np.flatnonzero(long) if np.isfinite(value[ends[k]])]


def _goes_on_with_a_jump(value: Array, rows: tuple[int, int], stretches: list[tuple[int, int]]) -> bool:
    """Whether the value leaves a stretch by a jump out of all proportion to its other steps, and moves on."""
    step, ends = np.abs(np.diff(value)), np.array([last for _, last in stretches])
    others = np.delete(step, ends[ends < step.size])
    if rows[1] >= step.size - _BESIDE or sum(last - first for first, last in stretches) > _HALF * value.size:
        return False
    usual = float(np.nanmax(others))
    jump, after = step[rows[1]], abs(float(value[rows[1] + 1 + _BESIDE] - value[rows[1] + 1]))
    return bool(jump > max(_LARGER * usual, _LARGER * _step(value)) and after > _HALF * usual)


def _moves(signal: str, time: Array, position: Array, velocity: Array, rows: slice) -> bool:
    """Whether the other sensor shows a motion in the rows of a stretch."""
    if signal == "position":
        usual, here = (float(np.sqrt(np.nanmean(one**2))) for one in (velocity, velocity[rows]))
        interval = np.diff(time[rows])
        travel = np.nancumsum(velocity[rows][1:] * interval)
        # The noise of a velocity adds up to a walk.
        walk = white_noise(velocity[np.isfinite(velocity)]) * float(np.sqrt(np.sum(interval**2)))
        least = _STEPS * _step(position) + _WALK * walk
        gone = float(np.max(np.abs(travel)))
        # Of an axis that stands still a late velocity shows the motion before, and the position goes on without a jump.
        beyond = abs(float(np.sum(np.diff(position[rows.stop - 1 : rows.stop + 1]))))
        late = _last_half(velocity[rows]) < _MOVING * usual and beyond < _HALF * gone
        return here > _MOVING * usual and gone > least and not late
    within = time[rows]
    place = np.interp(np.linspace(within[0], within[-1], _PARTS + 1), within, position[rows])
    slope = np.diff(place) * _PARTS / (within[-1] - within[0])
    known = np.isfinite(position)
    usual = float(np.sqrt(np.mean(np.gradient(position[known], time[known]) ** 2)))
    beside = float(np.sqrt(np.mean((slope - velocity[rows][0]) ** 2)))
    moved = float(np.ptp(position[rows])) > _STEPS * _step(position)
    return moved and beside > max(_MOVING * usual, 2.0 * _step(velocity))


def _last_half(value: Array) -> float:
    """Size of a signal in the second half of a stretch."""
    known = value[value.size // 2 :]
    known = known[np.isfinite(known)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0


def _step(value: Array) -> float:
    """The smallest usual change between samples; 0 without any."""
    change = np.abs(np.diff(value))
    change = change[np.isfinite(change) & (change > 0.0)]
    return float(np.quantile(change, 0.01)) if change.size else 0.0
