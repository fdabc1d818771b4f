"""Whether a recorded velocity is the derivative of the recorded position.

A column in another unit, with the wrong sign, without motion or of another signal is not the velocity of this joint,
and a fit that uses it is wrong by as much. The integral of a velocity over a window is the increment of the position.
The windows are long compared with noise, encoder steps and delays, so that the slope of the integral against the
position is 1 even for a noisy, coarse, late or filtered velocity. A finding needs parts of the record that agree on
another slope, or on none.

A filter lowers that slope. Its output ``u`` obeys ``u = w - delay du/dt`` with the velocity ``w``, and its integral is
the increment of the position less the delay times its own increment: with both, and a bias, the slope is 1 for a
filtered velocity as well, and an error of the scale of some hundredths is told from a filter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from idloop.arrays import Array, Mask
from idloop.records.finding import Finding
from idloop.records.inspection.motion import analyse_motion, white_noise
from idloop.records.inspection.response import regress
from idloop.records.inspection.values import without_bad_readings
from idloop.records.inspection.velocity_limit import VelocityLimit, velocity_limit
from idloop.records.record import Record

KIND = "wrong_velocity"

# Slopes of a velocity: a filter with its corner at the frequency of the motion halves it, no filter increases it.
_LOWEST, _HIGHEST = 0.5, 1.25
# Standard errors by which the slope lies outside of that.
_ERRORS = 4.0
# ... and beside its delay by this share and so many standard errors.
_SCALE, _CERTAIN = 0.04, 5.0
_OVERLAP = 16  # windows that begin within one
# The longest window counts of those whose error is up to this factor, and this share, above the least.
_LONGEST = (2.0, 0.002)
_RELATED = 0.5  # correlation of its integral with the position below which a velocity of little noise is another signal
# Fewest samples in a window, and windows side by side in a record; instants used of a long record.
_FEWEST, _WINDOWS, _MOST = 5, 16, 100_000
_PARTS, _FEWEST_PARTS = 12, 4  # parts of the motion for the jackknife error of the slope, at most and at least
# Increments exceed the noise and the step of the position, and the travel at the step of the velocity, by this factor.
_ABOVE = 5.0
# A window is long enough where its largest increment is this share of the largest over any window; increments below the
# second share of that are standstill.
_FAR, _STILL = 0.4, 0.1
# A position step of this many times those around it is a wrap or a glitch; a pause of this many intervals is a gap.
_JUMP, _GAP = 10.0, 5.0
_NONE, _UNIT = 0.01, 0.04  # a slope below the first is zero; to the accuracy of the second it is the factor of a unit
# Units that a mapping can confuse, in the unit of the topics.
_ANGULAR = {"rad/s": 1.0, "rpm": pi / 30.0, "deg/s": pi / 180.0, "rev/s": 2.0 * pi, "mrad/s": 1e-3}
_LINEAR = {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2, "m/min": 1.0 / 60.0, "mm/min": 1e-3 / 60.0}
# ... of which these are seldom that of a log.
_SELDOM = ("mrad/s", "mrad")
# Units of time, the one that it was read in, and what the slope is then.
_CLOCKS = (("ms", "s", 1e3), ("us", "s", 1e6), ("ns", "s", 1e9), ("s", "ms", 1e-3))
_READINGS = 2  # told of a slope, at most


@dataclass(frozen=True)
class Slope:
    """The slope of a velocity's integral against the position."""

    # Slope over all motion, and its standard error
    value: float
    error: float
    unrelated: bool  # whether the integral of the velocity is uncorrelated with the position
    wrong: bool  # whether the velocity is certainly not the derivative of this position
    limit: VelocityLimit | None = None  # where the velocity is cut off

    @property
    def undecided(self) -> bool:
        """Whether the slope is neither certainly wrong nor that of a velocity."""
        return not self.wrong and not _LOWEST <= self.value <= _HIGHEST


def velocity_slope(time: Array, position: Array, velocity: Array) -> Slope | None:
    """Slope of the velocity's integral against the position.

    `time` (n,): stamps [s], increasing.
    `position`, `velocity` (n,): in matching units; NaN where not measured, possibly at different stamps.
    Returns: None where the motion is too small for a decision.
    """
    when, where = _known(time, position)
    speed_time, speed = _known(time, velocity)
    if min(when.size, speed_time.size) < _FEWEST * _WINDOWS:
        return None
    area = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(speed_time))])
    gaps = np.concatenate([[0], np.cumsum(_is_gap(speed_time))])
    both = (when >= speed_time[0]) & (when <= speed_time[-1])
    when, where = when[both], where[both]
    if when.size < _FEWEST * _WINDOWS:
        return None
    broken = _is_gap(when) | _is_jump(where) | (np.diff(gaps[np.searchsorted(speed_time, when, side="right") - 1]) > 0)
    series = np.array([where, np.interp(when, speed_time, area), when, np.concatenate([[0], np.cumsum(broken)])])
    # A long record at fewer instants: the integral is exact at each.
    some = slice(None, None, max(when.size // _MOST, 1))
    increments, length = _increments(series[:, some])
    count = min(2 * increments.shape[1] // length, _PARTS)
    if count < _FEWEST_PARTS:
        return None
    # Sums of products of increments of position, integral and time: of all, and without each part.
    parts = np.array([part @ part.T for part in np.array_split(increments, count, axis=1)])
    sums = np.concatenate([[np.sum(parts, axis=0)], np.sum(parts, axis=0) - parts]) / increments.shape[1]
    passed = float(sums[0, 2, 2]) ** 0.5
    least = _ABOVE * max(_step(where), white_noise(where), _step(speed) * passed)
    noise = _ABOVE * white_noise(speed) * (float(np.median(np.diff(speed_time))) * passed) ** 0.5
    plain = _slope(sums[:, :2, :2], least, noise)
    # A bias of the velocity must not change the slope, but at a nearly constant speed only the whole motion shows it.
    across = sums[:, :2, 2]
    freed = _slope(sums[:, :2, :2] - across[:, :, None] * across[:, None, :] / sums[:, 2:, 2:], least, noise)
    if plain is None or freed is None:
        return plain
    found = replace(min(plain, freed, key=lambda one: one.error), wrong=plain.wrong and freed.wrong)
    # A delay makes the slope beside the increment of the velocity larger than 1, and the slope alone smaller.
    off = [one.value - 1.0 for one in (plain, freed)]
    if found.wrong or min(np.abs(off)) < 0.5 * _SCALE or off[0] * off[1] < 0.0:
        return found
    # A velocity that was differenced by a fixed period between uneven stamps is larger over the longer ones.
    between = np.diff(speed_time)
    tolerance = 0.5 * float(np.var(between) / np.mean(between) ** 2)
    scale = _scale(series[:, some], np.interp(when[some], speed_time, speed), speed, tolerance)
    # Beyond these bounds the slope alone would have shown it: the velocity follows no such filter.
    likely = scale is not None and _LOWEST <= scale.value <= _HIGHEST and (scale.value - 1.0) * off[0] > 0.0
    return scale if likely else found


def _known(time: Array, value: Array) -> tuple[Array, Array]:
    known = np.isfinite(time) & np.isfinite(without_bad_readings(value))
    return time[known], value[known]


def _step(value: Array) -> float:
    """Smallest step between two values that occur; 0 where there is one only."""
    motion = analyse_motion(value)
    return 0.0 if motion is None else motion.resolution


def breaks(time: Array, position: Array) -> Mask:
    """Intervals (n-1,) at which a motion is broken off: a pause, a wrap, a glitch, another record.

    Steps are those to the next value: a sensor that is slower than the log repeats its values, which is no jump.
    """
    changed = np.flatnonzero(np.diff(position))
    broken = _is_gap(time)
    if changed.size:
        broken[changed[_is_jump(position[np.concatenate([[0], changed + 1])])]] = True
    return broken


def _is_gap(time: Array) -> Mask:
    step = np.diff(time)
    return np.asarray(step > _GAP * np.median(step))


def _is_jump(position: Array) -> Mask:
    """Whether a position steps by far more than around there, shape (n - 1,)."""
    step = np.abs(np.diff(position))
    around = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(step, 3, mode="edge"), 7), axis=1)
    return np.asarray(step > _JUMP * np.maximum(around, _step(position)))


def _lengths(series: Array) -> list[int]:
    """Lengths of windows, doubled each time, up to a part of a record (., n)."""
    most = series.shape[1] // _WINDOWS
    return [*(_FEWEST << k for k in range(most.bit_length()) if _FEWEST << k < most), most]


def _increments(series: Array) -> tuple[Array, int]:
    """Return the increments (3, k) of the first three series where there is motion, and their window in samples.

    `series` (4, n) are position, integral of the velocity, time, and the number of breaks before.
    """
    lengths = _lengths(series)
    found = []
    for length in lengths:
        step = series[:, length:] - series[:, :-length]
        found.append(step[:3, step[3] == 0.0])
    largest = np.array([np.max(np.abs(one[0]), initial=0.0) for one in found])
    chosen = int(np.argmax(largest >= _FAR * np.max(largest)))
    moved = np.abs(found[chosen][0])
    return found[chosen][:, moved > _STILL * largest[chosen]], lengths[chosen]


def _slope(sums: Array, least: float, noise: float) -> Slope | None:
    """Return slope and jackknife error from mean products of the increments of a position and an integral.

    `sums` (parts + 1, 2, 2) are those of all parts, then without each of them; increments up to `least` are no motion,
    those of the integral up to `noise` are noise.
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


def _scale(series: Array, speed: Array, recorded: Array, tolerance: float) -> Slope | None:
    """Return the slope beside a delay where it is certainly not 1; None otherwise.

    `series` is that of `_increments`, `speed` (n,) the velocity at its instants, `recorded` the one at its own stamps.
    """
    found = []
    for length in _lengths(series):
        # Neighbouring windows hold the same motion.
        every = max(length // _OVERLAP, 1)
        step = (series[:, length:] - series[:, :-length])[:, ::every]
        changed = (speed[length:] - speed[:-length])[::every]
        whole = (step[3] == 0.0) & (np.abs(step[0]) > _STILL * np.max(np.abs(step[0][step[3] == 0.0]), initial=0.0))
        (moved, area, passed), changed = step[:3, whole], changed[whole]
        table = np.column_stack([moved, changed, passed])
        if len(table) * every * 2 >= _FEWEST_PARTS * length:
            # At a nearly constant speed the whole motion looks like a bias.
            both = [regress(area, table[:, :count]) for count in (3, 2)]
            value, error = (float(part[0]) for part in min(both, key=lambda one: float(one[1][0]))[:2])
            off = min(abs(float(values[0]) - 1.0) - _CERTAIN * float(errors[0]) for values, errors, _ in both)
            found.append((error, length, value, off))
    if not found:
        return None
    factor, share = _LONGEST
    enough = factor * min(found)[0] + share
    error, _, value, off = max((one for one in found if one[0] <= enough), key=lambda one: one[1])
    # A velocity that is rounded towards zero is too small by half a step.
    rounding = _step(recorded) / max(float(np.sqrt(np.mean(recorded**2))), 1e-300)
    return Slope(value, error, unrelated=False, wrong=True) if off > _SCALE + rounding + tolerance else None


def wrong_velocities(
    time: Array, columns: Mapping[str, Array], units: Mapping[str, str], scales: Mapping[str, float] | None = None
) -> list[Finding]:
    """Find velocities that are not the derivatives of the positions of their joints.

    `time` (n,): stamps [s].
    `columns` (n,): by ``joint.field``; NaN where not measured.
    `units`: by ``joint.field``; rad and rad/s where not known.
    `scales`: factors by which columns are divided to be in their unit, where not 1.
    Returns: of kind `KIND`; ``where`` is the velocity.
    """
    slopes = _slopes(time, columns, units, scales or {})
    return [_finding(name, slope, columns, units) for name, slope in slopes.items() if slope.wrong]


def _slopes(
    time: Array, columns: Mapping[str, Array], units: Mapping[str, str], scales: Mapping[str, float]
) -> dict[str, Slope]:
    """Slopes of the velocities whose joint has a position, where the motion is large enough."""
    found = {}
    for name in columns:
        joint, _, field = name.rpartition(".")
        place = f"{joint}.position"
        # The volts of a tachometer have no known slope against an angle.
        belong = (units.get(name) or "rad/s") == f"{units.get(place) or 'rad'}/s"
        if field != "velocity" or place not in columns or not belong:
            continue
        scaled = [columns[one] / scales.get(one, 1.0) for one in (place, name)]
        if (slope := velocity_slope(time, *scaled)) is not None:
            limit = velocity_limit(time, *scaled)
            found[name] = slope if limit is None else replace(slope, wrong=True, limit=limit)
    return found


def _finding(name: str, slope: Slope, columns: Mapping[str, Array], units: Mapping[str, str]) -> Finding:
    seen, cure = _explanation(name, slope, columns, units.get(name) or "rad/s")
    cure = f"{cure}; fits leave {name} out"
    evidence = {"slope": slope.value, "error": slope.error}
    if slope.limit is not None:
        evidence |= {"limit": slope.limit.value, "share": slope.limit.share}
    return Finding(KIND, f"{seen}; {cure}", where=name, level="warning", evidence=evidence, cure=cure)


def _explanation(name: str, slope: Slope, columns: Mapping[str, Array], unit: str) -> tuple[str, str]:
    """Return what is wrong with a velocity and the evidence, and how to correct it."""
    place, velocity = f"{name.rpartition('.')[0]}.position", columns[name]
    if np.nanmin(velocity) == np.nanmax(velocity):
        ends = f"from {np.nanmin(columns[place]):.4g} to {np.nanmax(columns[place]):.4g}"
        still = f"{name} stays at {np.nanmin(velocity):g} while {place} runs {ends}: it is not measured"
        return still, "take it out of the mapping and of the model file"
    if (limit := slope.limit) is not None:
        said = f"{name} stays at its limit of {limit.value:.4g} {unit} in {100 * limit.share:.2g} % of the samples"
        beyond = f"{place} goes {limit.faster:.3g} times as fast there"
        return f"{said}, but {beyond}: its sensor, or what computes it, cuts it off", "raise the limit, or drive slower"
    value, least = slope.value, _ERRORS * slope.error
    readings = _misread(value, unit)
    # Of millimetres that were read as metres a thousandth is left, which is exact.
    none = 0.0 if readings and slope.error <= _UNIT * abs(value) else _NONE
    if slope.unrelated or abs(value) <= max(least, none):
        unlike = f"{name} is unrelated to the slope of {place} ({value:.2g} ± {slope.error:.2g}, not 1): another signal"
        return unlike, "correct the mapping, or take it out of the model file"
    times = f"{name} is {value:.4g} ± {slope.error:.1g} times the slope of {place}"
    if abs(value + 1.0) <= max(least, _UNIT):
        return f"{times}: one of the two has the wrong sign", "set `scale: -1` for it in the mapping"
    if readings:
        names = {"velocity": name, "position": place, "time": "the time"}
        seen = ", or ".join(
            f"{names[own]} is {'' if number else 'probably '}in {right} and was read as {wrong}"
            for number, (own, right, wrong) in enumerate(readings)
        )
        return f"{times}: {seen}", "; or ".join(_unit_cure(own, right) for own, right, _ in readings)
    if _LOWEST <= value <= _HIGHEST:
        # Neither a unit nor a gear.
        return (
            f"{times}, its delay not counted: a wrong scale, or a driver that divides by another sample time",
            f"multiply its `scale:` in the mapping by {1.0 / value:.4g}",
        )
    clock = f", a sample time that is {max(value, 1.0 / value):.4g} times too {'long' if value > 1.0 else 'short'}"
    return (
        f"{times}: a wrong scale{clock if value > 0.0 else ''}, the other side of a gear, or another signal",
        "correct `time:`, or its `unit:` or `scale:`, in the mapping",
    )


def _unit_cure(signal: str, unit: str) -> str:
    key = f"time: {{unit: {unit}}}" if signal == "time" else f"unit: {unit}"
    return f"`idloop start --{signal} COLUMN={unit}`, or `{key}` in the mapping"


def _misread(value: float, unit: str) -> list[tuple[str, str, str]]:
    """Return which signals were probably read in another unit by the slope of a velocity, the most probable first.

    A velocity in the unit of the topics, `unit`, was probably read in that unit. Where no unit of it explains the
    slope, that of the position or the time does.

    Returns: signal (``velocity``, ``position`` or ``time``), its unit, and the one in which it was read.
    """
    table = _ANGULAR if unit in _ANGULAR else _LINEAR if unit in _LINEAR else {}

    def explains(factor: float) -> bool:
        return abs(value / factor - 1.0) <= _UNIT

    speeds = [
        ("velocity", right, wrong)
        for wrong in table
        for right in table
        if right != wrong and explains(table[wrong] / table[right])
    ]
    lengths = [name for name in table if name != unit and name.endswith("/s") and explains(table[name])]
    places = [("position", name.removesuffix("/s"), unit.removesuffix("/s")) for name in lengths]
    clocks = [("time", right, wrong) for right, wrong, factor in _CLOCKS if table and explains(factor)]
    as_read = [one for one in speeds if one[2] == unit][:1]
    others = [one for one in speeds if one[2] != unit][:1]
    return sorted([*as_read, *places, *clocks, *others], key=lambda one: one[1] in _SELDOM)[:_READINGS]


def without_wrong_velocities(
    records: Sequence[Record], scales: Mapping[str, float] | None = None, known: Sequence[Finding] = ()
) -> list[Record]:
    """Return records of the same sensors without the velocities that are not the derivatives of their positions.

    `scales`: as in `wrong_velocities`.
    `known`: findings on earlier records of these sensors.
    Returns: with NaN in place of such a velocity, and a finding. A record with too little motion for a decision follows
    the others.
    """
    every = []
    for record in records:
        table = dict(zip(record.output_names, record.output.T, strict=True))
        units = dict(zip(record.output_names, record.output_units, strict=True))
        every.append((record, table, units, _slopes(record.time, table, units, scales or {})))
    wrong = {one.where: "records before" for one in known}
    wrong |= {name: record.name for record, _, _, own in every for name in own if own[name].wrong}
    left = []
    for record, table, units, own in every:
        found = [_finding(name, own[name], table, units) for name in own if own[name].wrong]
        found += [
            Finding(KIND, f"{name} is left out as in {wrong[name]}: too little motion for a decision", where=name)
            for name in wrong
            if name in table and (name not in own or own[name].undecided)
        ]
        left.append(_without(record, found) if found else record)
    return left


def _without(record: Record, found: Sequence[Finding]) -> Record:
    names = {one.where for one in found}
    output = record.output.copy()
    output[:, [record.column(name) for name in names]] = np.nan
    # Other findings on such a velocity do not matter any more.
    kept = [one for one in record.findings if one.where not in names]
    return replace(record, output=output, findings=(*kept, *found))
