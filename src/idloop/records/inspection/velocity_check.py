"""Whether a recorded velocity is the derivative of the recorded position at all.

A column of another unit, with its sign turned, without any motion or of another signal is no velocity of this joint,
and a fit that believes it is wrong by as much. The integral of a velocity over a window is the position's increment
there: windows are long beside noise, encoder steps and delays, so that the slope of the one against the other is 1
however noisy, coarse, late or filtered the velocity is. Parts of the record must agree on another slope, or on none,
before anything is said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from idloop.records.finding import Finding
from idloop.records.inspection.motion import analyse_motion, white_noise
from idloop.records.record import Record

Floats = NDArray[np.float64]

KIND = "wrong_velocity"

# Slopes that a velocity may have: a filter whose corner lies at the motion's frequency leaves half, none adds any.
_LOWEST, _HIGHEST = 0.5, 1.25
# Standard errors by which the slope lies outside of that.
_ERRORS = 4.0
# A velocity whose integral correlates less with the position than this, though its noise is small in it, is of another
# signal.
_RELATED = 0.5
# Fewest samples in a window, and windows side by side in a record.
_FEWEST, _WINDOWS = 5, 16
# Parts of the motion of which each is left out in turn for the error of the slope, at most and at least.
_PARTS, _FEWEST_PARTS = 12, 4
# Increments are this many times the position's noise or step, and the travel at the velocity's step.
_ABOVE = 5.0
# A window is long enough where some increment is this part of the largest over any; what moves less than the second
# part of that stands still.
_FAR, _STILL = 0.4, 0.1
# A step of the position beyond this many of those around it is a wrap or a glitch; a longer pause than this a hole.
_JUMP, _HOLE = 10.0, 5.0
# A slope below this is none; one is that of a unit to this part.
_NONE, _UNIT = 0.01, 0.04
# What a mapping can take for each other, in the unit of the topics.
_ANGULAR = {"rad/s": 1.0, "rpm": pi / 30.0, "deg/s": pi / 180.0, "rev/s": 2.0 * pi, "mrad/s": 1e-3}
_LINEAR = {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2, "m/min": 1.0 / 60.0, "mm/min": 1e-3 / 60.0}


@dataclass(frozen=True)
class Slope:
    """The slope of a velocity's integral against the position.

    Attributes
    ----------
    value, error : float
        Of all motion, and its standard error.
    unrelated : bool
        Whether the velocity's integral goes its own way.
    wrong : bool
        Whether the velocity is none of this position; else it is, as far as can be told.
    """

    value: float
    error: float
    unrelated: bool
    wrong: bool

    @property
    def untold(self) -> bool:
        """Whether it is neither wrong nor that of a velocity."""
        return not self.wrong and not _LOWEST <= self.value <= _HIGHEST


def velocity_slope(time: Floats, position: Floats, velocity: Floats) -> Slope | None:
    """Slope of the velocity's integral against the position.

    Parameters
    ----------
    time : array, shape (n,)
        Stamps [s], increasing.
    position, velocity : array, shape (n,)
        In units that belong together; NaN where not measured, be it at other stamps.

    Returns
    -------
    Slope or None
        None where too little moves to tell.
    """
    when, where = _known(time, position)
    told, speed = _known(time, velocity)
    if min(when.size, told.size) < _FEWEST * _WINDOWS:
        return None
    area = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(told))])
    holes = np.concatenate([[0], np.cumsum(_is_hole(told))])
    both = (when >= told[0]) & (when <= told[-1])
    when, where = when[both], where[both]
    if when.size < _FEWEST * _WINDOWS:
        return None
    broken = _is_hole(when) | _is_jump(where) | (np.diff(holes[np.searchsorted(told, when, side="right") - 1]) > 0)
    series = np.array([where, np.interp(when, told, area), when, np.concatenate([[0], np.cumsum(broken)])])
    increments, length = _increments(series)
    count = min(2 * increments.shape[1] // length, _PARTS)
    if count < _FEWEST_PARTS:
        return None
    # Sums of products of increments of position, integral and time: of all, and without each part.
    parts = np.array([part @ part.T for part in np.array_split(increments, count, axis=1)])
    sums = np.concatenate([[np.sum(parts, axis=0)], np.sum(parts, axis=0) - parts]) / increments.shape[1]
    passed = float(sums[0, 2, 2]) ** 0.5
    least = _ABOVE * max(_step(where), white_noise(where), _step(speed) * passed)
    noise = _ABOVE * white_noise(speed) * (float(np.median(np.diff(told))) * passed) ** 0.5
    plain = _slope(sums[:, :2, :2], least, noise)
    # A bias is none of the slope; at a nearly constant speed, though, only the whole motion shows the slope.
    across = sums[:, :2, 2]
    freed = _slope(sums[:, :2, :2] - across[:, :, None] * across[:, None, :] / sums[:, 2:, 2:], least, noise)
    if plain is None or freed is None:
        return plain
    return replace(min(plain, freed, key=lambda one: one.error), wrong=plain.wrong and freed.wrong)


def _known(time: Floats, value: Floats) -> tuple[Floats, Floats]:
    known = np.isfinite(time) & np.isfinite(value)
    return time[known], value[known]


def _step(value: Floats) -> float:
    """Smallest step between two values that occur; 0 where there is one only."""
    motion = analyse_motion(value)
    return 0.0 if motion is None else motion.resolution


def _is_hole(time: Floats) -> NDArray[np.bool_]:
    step = np.diff(time)
    return np.asarray(step > _HOLE * np.median(step))


def _is_jump(position: Floats) -> NDArray[np.bool_]:
    """Whether a position steps by far more than around there, shape (n - 1,)."""
    step = np.abs(np.diff(position))
    around = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(step, 3, mode="edge"), 7), axis=1)
    return np.asarray(step > _JUMP * np.maximum(around, _step(position)))


def _increments(series: Floats) -> tuple[Floats, int]:
    """Increments where there is motion, and the samples that each is over.

    Parameters
    ----------
    series : array, shape (4, n)
        Position, integral of the velocity, time, and how often the position broke off before.

    Returns
    -------
    increments : array, shape (3, k)
    length : int
    """
    most = series.shape[1] // _WINDOWS
    lengths = [*(_FEWEST << k for k in range(most.bit_length()) if _FEWEST << k < most), most]
    found = []
    for length in lengths:
        step = series[:, length:] - series[:, :-length]
        found.append(step[:3, step[3] == 0.0])
    largest = np.array([np.max(np.abs(one[0]), initial=0.0) for one in found])
    chosen = int(np.argmax(largest >= _FAR * np.max(largest)))
    moved = np.abs(found[chosen][0])
    return found[chosen][:, moved > _STILL * largest[chosen]], lengths[chosen]


def _slope(sums: Floats, least: float, noise: float) -> Slope | None:
    """Slope by mean products of the increments of a position and an integral, and its error by the jackknife.

    Parameters
    ----------
    sums : array, shape (parts + 1, 2, 2)
        Of all, then without each of the parts.
    least, noise : float
        What counts as motion of the position, and what noise makes of the integral.

    Returns
    -------
    Slope or None
        None where too little moves.
    """
    moved, area = (max(float(sums[0, k, k]), 0.0) ** 0.5 for k in (0, 1))
    if moved <= least:
        return None
    value, *others = sums[:, 0, 1] / sums[:, 0, 0]
    count = len(others)
    error = float(np.std(others) * np.sqrt(count - 1.0))
    outside = value - _ERRORS * error > _HIGHEST or value + _ERRORS * error < _LOWEST
    unrelated = bool(area > noise and abs(value) * moved < _RELATED * area)
    return Slope(float(value), error, unrelated, bool(outside or unrelated))


def wrong_velocities(
    time: Floats, columns: Mapping[str, Floats], units: Mapping[str, str], scales: Mapping[str, float] | None = None
) -> list[Finding]:
    """Say which velocities are none of the positions of their joints.

    Parameters
    ----------
    time : array, shape (n,)
        Stamps [s].
    columns : mapping of str to array, shape (n,)
        By ``joint.field``; NaN where not measured.
    units : mapping of str to str
        By ``joint.field``; where one is not known, rad and rad/s are taken.
    scales : mapping of str to float, optional
        What a column is divided by to be in its unit, where that is not 1.

    Returns
    -------
    list of Finding
        Of kind `KIND`, ``where`` names the velocity.
    """
    slopes = _slopes(time, columns, units, scales or {})
    return [_finding(name, slope, columns, units) for name, slope in slopes.items() if slope.wrong]


def _slopes(
    time: Floats, columns: Mapping[str, Floats], units: Mapping[str, str], scales: Mapping[str, float]
) -> dict[str, Slope]:
    """Slopes of the velocities that have a position of their joint beside them, as far as they can be told."""
    found = {}
    for name in columns:
        joint, _, field = name.rpartition(".")
        place = f"{joint}.position"
        # A tachometer's volts have no known slope against an angle.
        belong = (units.get(name) or "rad/s") == f"{units.get(place) or 'rad'}/s"
        if field != "velocity" or place not in columns or not belong:
            continue
        scaled = [columns[one] / scales.get(one, 1.0) for one in (place, name)]
        if (slope := velocity_slope(time, *scaled)) is not None:
            found[name] = slope
    return found


def _finding(name: str, slope: Slope, columns: Mapping[str, Floats], units: Mapping[str, str]) -> Finding:
    what = _what(name, slope, columns, units.get(name) or "rad/s")
    return Finding(KIND, f"{what}; fits go on without {name}", where=name, level="warning")


def _what(name: str, slope: Slope, columns: Mapping[str, Floats], unit: str) -> str:
    """What is wrong with a velocity, by what evidence, and how to mend it."""
    joint = name.rpartition(".")[0]
    place, velocity = f"{joint}.position", columns[name]
    low, high = float(np.nanmin(velocity)), float(np.nanmax(velocity))
    if low == high:
        ends = f"from {np.nanmin(columns[place]):.4g} to {np.nanmax(columns[place]):.4g}"
        return (
            f"{name} stays at {low:g} while {place} runs {ends}: it is not measured; take it out of the mapping and of"
            " the model file"
        )
    value, least = slope.value, _ERRORS * slope.error
    if slope.unrelated or abs(value) <= max(least, _NONE):
        return (
            f"{name} has nothing to do with the slope of {place} ({value:.2g} ± {slope.error:.2g} times it, not 1): the"
            " column is another signal's or noise; mend the mapping, or take it out of the model file"
        )
    times = f"{name} is {value:.4g} times the slope of {place}"
    if abs(value + 1.0) <= max(least, _UNIT):
        return f"{times}: one of the two has its sign turned; say `scale: -1` for it in the mapping"
    taken = _taken_for(value, unit)
    if taken is not None:
        right, wrong = taken
        return f"{times}: it is probably in {right}, taken for {wrong}; say `unit: {right}` in the mapping"
    return (
        f"{times}: one of the two is scaled wrongly, or the column is another signal's; say its `unit:` or `scale:`"
        " in the mapping"
    )


def _taken_for(value: float, unit: str) -> tuple[str, str] | None:
    """The unit that a velocity is in, and for which it was taken, by the slope."""
    table = _ANGULAR if unit in _ANGULAR else _LINEAR if unit in _LINEAR else {}
    pairs = [(right, wrong) for wrong in table for right in table if right != wrong]
    # Nobody said a unit: that of the topics was taken.
    pairs.sort(key=lambda pair: pair[1] != unit)
    for right, wrong in pairs:
        if abs(value * table[right] / table[wrong] - 1.0) <= _UNIT:
            return right, wrong
    return None


def without_wrong_velocities(
    records: Sequence[Record], scales: Mapping[str, float] | None = None, known: Sequence[Finding] = ()
) -> list[Record]:
    """Records of the same sensors, without the velocities that are none of the recorded positions.

    Parameters
    ----------
    records : sequence of Record
    scales : mapping of str to float, optional
        As in `wrong_velocities`.
    known : sequence of Finding
        On earlier records of these sensors.

    Returns
    -------
    list of Record
        NaN in place of such a velocity, and a finding. A record in which too little moves to tell follows the others.
    """
    tables = [dict(zip(one.output_names, one.output.T, strict=True)) for one in records]
    units = [dict(zip(one.output_names, one.output_units, strict=True)) for one in records]
    slopes = [
        _slopes(record.time, table, unit, scales or {})
        for record, table, unit in zip(records, tables, units, strict=True)
    ]
    wrong = {one.where: "records before" for one in known}
    wrong |= {name: record.name for record, own in zip(records, slopes, strict=True) for name in own if own[name].wrong}
    left = []
    for record, table, unit, own in zip(records, tables, units, slopes, strict=True):
        found = [_finding(name, own[name], table, unit) for name in own if own[name].wrong]
        found += [
            Finding(KIND, f"{name} is left out as in {wrong[name]}: too little moves to tell", where=name)
            for name in wrong
            if name in table and (name not in own or own[name].untold)
        ]
        left.append(_without(record, found))
    return left


def _without(record: Record, found: Sequence[Finding]) -> Record:
    if not found:
        return record
    names = {one.where for one in found}
    output = record.output.copy()
    output[:, [record.column(name) for name in names]] = np.nan
    # What else was found about such a velocity is of no use.
    kept = [one for one in record.findings if one.where not in names]
    return replace(record, output=output, findings=(*kept, *found))
