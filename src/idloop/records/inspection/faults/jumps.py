"""Jumps of a position: the wrap of its encoder, pulses that were missed, samples that were lost, joined recordings."""

from __future__ import annotations

from math import pi

import numpy as np

from idloop.arrays import Array, Integers
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import around, fault, times
from idloop.records.inspection.faults.spikes import driven, isolated
from idloop.records.inspection.motion import white_noise
from idloop.records.inspection.response import response

SPLICED = "spliced"

# Usual ranges of encoders, in any unit, taken where the jumps are as large to this accuracy.
_RANGES = (2.0 * pi, pi, 1.0, 360.0, 180.0, *(float(1 << bits) for bits in range(8, 25)))
_NEAR = 0.01
_FEWEST_SAMPLES = 200

# Of one or two jumps: times the largest of all other steps; most jumps; longest interval, in the usual one.
_LARGER, _MOST_SPLICES, _LONGEST = 5.0, 2, 1.2
# Before or after it the axis moves over so many samples by so many times its noise and its step: a log that is slow
# beside the motion holds a whole move between two samples at rest.
_MOVED, _MOVES = 8, 5.0

# Of many: jumps needed; the largest share of the steps that jump, which lost samples may exceed; uneven intervals are
# left out.
_FEWEST, _MOST, _UNEVEN = 3, 0.02, 0.2
_INTERVAL = 1.96  # standard errors to each side of a 95 % interval
# Jumps are samples where this share of them is, up to the second share of it, what the axis travels in whole samples.
# Pulses missed at one speed may be as large as that by chance; at speeds that differ so many times they are not.
_SAMPLES, _WHOLE, _SPEEDS = 0.8, 0.15, 1.5
# Many samples were left out where this share of the jumps goes on along the motion, by more than so many samples, and
# between the means over so many steps before and after it the speed changes more than chance, of this probability, has.
_ALONG, _MANY, _BESIDE, _CHANCE = 0.8, 1.5, 4, 1e-3

# Under a constant command the speed falls to between these shares of its peak and stays within the scatter there.
_FALLS, _STAYS, _SCATTER = 0.5, 0.03, 0.25
_WINDOWS, _SHARE = 24, 0.25


def wrapped(axis: Axis) -> Finding | None:
    """A position that jumps by the range of its encoder."""
    wraps = axis.wraps
    if wraps is None:
        return None
    name, unit = axis.name("position"), axis.unit("position")
    usual = next((one for one in _RANGES if abs(wraps.span / one - 1.0) < _NEAR), None)
    span, count = usual or wraps.span, wraps.rows.size
    or_else = ", or two recordings were joined" if count == 1 and usual is None else ""
    return fault(
        "wrapped_position",
        name,
        f"{name} jumps {times(count)} by {span:.4g} {unit} from one end of its range to the other: the encoder wraps"
        f"{or_else}",
        f"set `wrap: {span:.7g}` for it in the mapping, or use `Record.unwrapped`",
        evidence={"span": wraps.span, "jumps": count},
        spoils=("identification",),
        places=around(axis.time, wraps.rows),
    )


def _positions(axis: Axis) -> tuple[Array, Array] | None:
    """Stamps and values of a position; None where there are too few."""
    if axis.place is None or np.count_nonzero(known := np.isfinite(axis.place)) < _FEWEST_SAMPLES:
        return None
    return axis.time[known], axis.place[known]


def spliced(axis: Axis) -> Finding | None:
    """Two recordings joined without a gap, samples lost, or a position set to another value while recording.

    The position jumps once or twice, by far more than it moves between any other two samples, and goes on from there:
    no axis with inertia does. Along the motion they may be samples that were lost.
    """
    positions = _positions(axis)
    if positions is None or axis.wraps is not None:
        return None
    time, place = positions
    step, resolution = np.diff(place), axis.resolution["position"]
    rows = isolated(step, resolution, np.diff(time) < _LONGEST * axis.period)
    rows = rows[(rows >= _MOVED) & (rows < step.size - _MOVED)]
    if not 1 <= rows.size <= _MOST_SPLICES:
        return None
    least = _MOVES * max(white_noise(place), resolution)
    before, after = place[rows] - place[rows - _MOVED], place[rows + 1 + _MOVED] - place[rows + 1]
    usual = float(np.abs(np.delete(step, rows)).max())
    if not ((np.abs(step[rows]) > _LARGER * usual) & (np.maximum(np.abs(before), np.abs(after)) > least)).all():
        return None
    name, unit = axis.name("position"), axis.unit("position")
    sizes = " and ".join(f"{step[row]:.3g} {unit} at {time[row + 1]:.4g} s" for row in rows)
    return fault(
        SPLICED,
        name,
        f"{name} jumps by {sizes} between two samples, otherwise by {usual:.2g} {unit} at most, and goes on from"
        f" there: {_causes(step[rows], before, after)}",
        "cut them apart with `rows:` in the mapping",
        evidence={"jump": np.abs(step[rows]).max(), "usual": usual},
        spoils=("identification",),
        places=around(time, rows + 1),
    )


def _causes(jumps: Array, before: Array, after: Array) -> str:
    """What may be behind the jumps, the most probable first, from the motion before and after each."""
    if not ((jumps * before > 0.0) & (jumps * after > 0.0)).all():
        return "two recordings were joined, samples were lost, or its zero was set"
    # One interval there is between any two samples.
    counts = [f"{count - 1.0:.0f}" for count in jumps / (0.5 * (before + after) / _MOVED)]
    number = f"about {' and '.join(counts)} at the speed there"
    return f"samples were lost ({number}), two recordings were joined, or its zero was set"


def missed_pulses(axis: Axis) -> Finding | None:
    """Pulses of an encoder that were missed or counted twice, a few at a time or all above some speed.

    The position jumps by some pulses for one sample and does not come back. Jumps by what the axis travels in whole
    samples, whatever its speed, are none of the encoder: samples were left out or recorded again. Nor are jumps along
    the motion at which the speed changes as well, more than it does elsewhere: many samples were left out.
    """
    positions = _positions(axis)
    return None if positions is None else _jumps(axis, *positions) or _collapse(axis, *positions)


def _jumps(axis: Axis, time: Array, place: Array) -> Finding | None:
    step, period = np.diff(place), np.diff(time)
    even = np.abs(period / axis.period - 1.0) < _UNEVEN
    rows = isolated(step, axis.resolution["position"], even)
    rows = rows[(rows > 1) & (rows < step.size - 2)]
    # Values that are repeated jump as well, when the next one catches up.
    rows = rows[~np.isin(rows, driven(axis)) & (step[rows - 1] != 0.0) & (step[rows + 1] != 0.0)]
    if rows.size < _FEWEST:
        return None
    travel = 0.5 * (step[rows - 1] + step[rows + 1])
    off = step[rows] - travel
    missed, size = int(np.sum(off * travel < 0.0)), float(np.median(np.abs(off)))
    name, unit, places = axis.name("position"), axis.unit("position"), around(time, rows + 1)
    seen, evidence = f"{name} jumps {rows.size} times", {"jumps": float(rows.size), "size": size}
    if _are_samples(off, travel, axis.resolution["position"]):
        lost = float(np.sum(np.round(off / travel)))
        share = lost / (step.size + lost)
        return fault(
            "lost_samples",
            name,
            f"{seen} by what it travels in a sample, whatever its speed, where the stamps go on evenly:"
            f" {rows.size - missed} times samples were left out, {missed} times one was sent again",
            "record the stamp or the counter of the device with each sample, and on its own clock",
            evidence={**evidence, "repeated": missed, "share": share},
            spoils=("inertia and friction", "delays") if _shifts_inertia(axis, share) else ("delays",),
            places=places,
        )
    if rows.size > _MOST * step.size:
        return None
    if count := _left_out(step, rows):
        return fault(
            "lost_samples",
            name,
            f"{seen} along the motion, by what it travels in {count:.0f} samples (median), and its speed is another one"
            " after each, where the stamps go on evenly: samples were left out",
            "record the stamp or the counter of the device with each sample, or cut the record there with `rows:` in"
            " the mapping",
            evidence=evidence,
            spoils=("delays", "flexible couplings", "play"),
            places=places,
        )
    # A jump is one acceleration of its size, and the next of the opposite sign.
    outweighs = 4.0 * float(np.sum(off**2)) > float(np.sum(np.diff(step) ** 2))
    return fault(
        "missed_pulses",
        name,
        f"{seen} by {size:.3g} {unit} for one sample and does not come back ({missed} times too short,"
        f" {rows.size - missed} times too far): pulses of the encoder were missed or counted twice",
        "count the pulses in hardware, shield the encoder, or drive slower",
        evidence={**evidence, "missed": missed},
        spoils=(*(("inertia and friction", "delays") if outweighs else ()), "flexible couplings", "play"),
        places=places,
    )


def _shifts_inertia(axis: Axis, share: float) -> bool:
    """Whether a share of the time that is missing moves the inertia out of its interval.

    Without it the motion looks faster by that share and its acceleration larger by twice the share.
    """
    seen = response(axis)
    return seen is not None and 2.0 * abs(share * seen.certainty) > _INTERVAL


def _are_samples(off: Array, travel: Array, step: float) -> bool:
    """Whether jumps (n,) are whole numbers of what the axis travels in a sample beside them (n,).

    Pulses that go missing may be so at one speed, or to a step of the sensor where the axis travels few in a sample,
    but they do not all go along the motion.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        samples = off / travel
    along = bool((samples > 0.0).all())
    exact = np.maximum(_WHOLE * np.abs(travel), step * (1.0 + np.abs(np.round(samples))) if along else 0.0)
    whole = np.isfinite(samples) & (np.round(samples) != 0.0)
    whole &= np.abs(off - np.round(samples) * travel) < exact
    speeds = np.abs(travel[whole])
    return bool(whole.mean() > _SAMPLES and (along or np.max(speeds) > _SPEEDS * np.min(speeds)))


def _left_out(step: Array, rows: Integers) -> float:
    """Samples that jumps at `rows` of the steps (n,) skip, by their median; 0 where they are none of the motion.

    Pulses go missing at a speed that stays what it was; after a piece of the motion it is another one.
    """
    from scipy.special import chdtrc

    far = np.ones(step.size, dtype=bool)
    for away in range(-_BESIDE, _BESIDE + 1):
        far[np.clip(rows + away, 0, step.size - 1)] = False
    far[:_BESIDE] = far[-_BESIDE:] = False
    usual = np.sort(np.abs(np.diff(_beside(step, np.flatnonzero(far)), axis=0))[0])
    sides = _beside(step, rows)
    travel = sides.mean(axis=0)
    along = ((step[rows] - travel) * np.sign(travel) > _MANY * np.abs(travel)) & (travel != 0.0)
    if np.mean(along) < _ALONG:
        return 0.0
    changed = np.abs(np.diff(sides, axis=0))[0][along]
    larger = (1 + usual.size - np.searchsorted(usual, changed)) / (1 + usual.size)
    # Fisher's combined probability that so many places of the motion chosen at random have such changes.
    chance = float(chdtrc(2 * larger.size, -2.0 * np.log(larger).sum()))
    return float(np.median(step[rows][along] / travel[along])) - 1.0 if chance < _CHANCE else 0.0


def _beside(step: Array, rows: Integers) -> Array:
    """Mean of the steps before and after each of the rows, shape (2, number of rows)."""
    begins = np.lib.stride_tricks.sliding_window_view(step, _BESIDE).mean(axis=1)
    last = begins.size - 1
    return np.array([begins[np.clip(rows - _BESIDE, 0, last)], begins[np.clip(rows + 1, 0, last)]])


def _collapse(axis: Axis, time: Array, place: Array) -> Finding | None:
    """A counted speed that rises under a constant command, and then falls to a part of it, which no drive does."""
    command_time, command = axis.input_time, axis.command
    if command.size < 2:
        return None
    change = np.flatnonzero(np.diff(command) != 0.0) + 1
    edges = np.concatenate([[command_time[0]], command_time[change], [max(command_time[-1], time[-1])]])
    values = command[np.concatenate([[0], change])]
    for start, stop, value in zip(edges[:-1], edges[1:], values, strict=True):
        if value == 0.0 or stop - start < _SHARE * (time[-1] - time[0]):
            continue
        grid = np.linspace(max(start, time[0]), min(stop, time[-1]), _WINDOWS + 1)
        if grid[-1] <= grid[0] or np.count_nonzero((time >= grid[0]) & (time <= grid[-1])) < 8 * _WINDOWS:
            continue
        speed = np.diff(np.interp(grid, time, place)) / np.diff(grid)
        top = int(np.argmax(np.abs(speed)))
        peak, end = float(speed[top]), speed[-(_WINDOWS // 6) :]
        left = float(np.median(end)) / peak if peak else 0.0
        if top < 2 or not _STAYS < left < _FALLS or np.ptp(end) > _SCATTER * abs(float(np.median(end))):
            continue
        name, unit = axis.name("position"), axis.unit("position")
        return fault(
            "missed_pulses",
            name,
            f"under a constant {axis.command_name} of {value:.4g} the speed of {name} rises to {peak:.4g} {unit}/s and"
            f" then falls to {left * peak:.4g} {unit}/s: above some speed pulses of the encoder are missed",
            "count the pulses in hardware, or drive slower",
            evidence={"peak": peak, "end": left * peak},
            spoils=("identification",),
            places=[(float(grid[top]), float(grid[-1]))],
        )
    return None
