"""Pulses of an encoder that were missed or counted twice.

A few at a time: the position jumps by some pulses for one sample and does not come back. All above some speed: under a
constant command the counted speed rises, and then falls to a part of it, which no drive does. Jumps by what the axis
travels in whole samples, whatever its speed, are none of the encoder: samples were left out or recorded again. Nor are
jumps along the motion at which the speed changes as well, more than it does elsewhere: many samples were left out.
"""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Integers
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import around, fault
from idloop.records.inspection.faults.local import isolated
from idloop.records.inspection.faults.spikes import driven
from idloop.records.inspection.response import response

# Jumps needed; the largest share of the steps that jump, which lost samples may exceed; uneven intervals are left out.
_FEWEST, _MOST, _UNEVEN = 3, 0.02, 0.2
# A 95 % interval reaches so many standard errors to each side.
_INTERVAL = 1.96
# Jumps are samples where this share of them is, up to the second share of it, what the axis travels in whole samples.
# Pulses missed at one speed may be as large as that by chance; at speeds that differ so many times they are not.
_SAMPLES, _WHOLE, _SPEEDS = 0.8, 0.15, 1.5
# Many samples were left out where this share of the jumps goes on along the motion, by more than so many samples, and
# between the means over so many steps before and after it the speed changes more than chance, of this probability, has.
_ALONG, _MANY, _BESIDE, _CHANCE = 0.8, 1.5, 4, 1e-3
# Under a constant command the speed falls to between these shares of its peak and stays within the scatter there.
_FALLS, _STAYS, _SCATTER = 0.5, 0.03, 0.25
_WINDOWS, _SHARE = 24, 0.25


def check(axis: Axis) -> list[Finding]:
    """Look for jumps of the position that stay, and for a speed that falls under a constant command."""
    if axis.place is None:
        return []
    known = np.isfinite(axis.place)
    time, place = axis.time[known], axis.place[known]
    if time.size < 200:
        return []
    return _jumps(axis, time, place) or _collapse(axis, time, place)


def _jumps(axis: Axis, time: Array, place: Array) -> list[Finding]:
    step, period = np.diff(place), np.diff(time)
    even = np.abs(period / axis.period - 1.0) < _UNEVEN
    rows = isolated(step, axis.resolution["position"], even)
    rows = rows[(rows > 1) & (rows < step.size - 2)]
    # Values that are repeated jump as well, when the next one catches up.
    rows = rows[~np.isin(rows, driven(axis)) & (step[rows - 1] != 0.0) & (step[rows + 1] != 0.0)]
    if rows.size < _FEWEST:
        return []
    travel = 0.5 * (step[rows - 1] + step[rows + 1])
    off = step[rows] - travel
    missed = int(np.sum(off * travel < 0.0))
    spoils = ("inertia and friction", "delays") if _outweigh(step, off) else ()
    size = float(np.median(np.abs(off)))
    name, unit = axis.name("position"), axis.unit("position")
    if _are_samples(off, travel, axis.resolution["position"]):
        lost = float(np.sum(np.round(off / travel)))
        share = lost / (step.size + lost)
        return [
            fault(
                "lost_samples",
                name,
                f"{name} jumps {rows.size} times by what it travels in a sample, whatever its speed, where the stamps"
                f" go on evenly: {rows.size - missed} times samples were left out, {missed} times one was sent again",
                "record the stamp or the counter of the device with each sample, and on its own clock",
                evidence={"jumps": float(rows.size), "size": size, "repeated": float(missed), "share": share},
                spoils=("inertia and friction", "delays") if _shifts(axis, share) else ("delays",),
                count=int(rows.size),
                places=around(time, rows + 1),
            )
        ]
    if rows.size > _MOST * step.size:
        return []
    if count := _left_out(step, rows):
        return [
            fault(
                "lost_samples",
                name,
                f"{name} jumps {rows.size} times along the motion, by what it travels in {count:.0f} samples (median),"
                " and its speed is another one after each, where the stamps go on evenly: samples were left out",
                "record the stamp or the counter of the device with each sample, or cut the record there with `rows:`"
                " in the mapping",
                evidence={"jumps": float(rows.size), "size": size},
                spoils=("delays", "flexible couplings", "play"),
                count=int(rows.size),
                places=around(time, rows + 1),
            )
        ]
    return [
        fault(
            "missed_pulses",
            name,
            f"{name} jumps {rows.size} times by {size:.3g} {unit} for one sample and does not come back ({missed} times"
            f" too short, {rows.size - missed} times too far): pulses of the encoder were missed or counted twice",
            "count the pulses in hardware, shield the encoder, or drive slower",
            evidence={"jumps": float(rows.size), "size": size, "missed": float(missed)},
            spoils=(*spoils, "flexible couplings", "play"),
            count=int(rows.size),
            places=around(time, rows + 1),
        )
    ]


def _outweigh(step: Array, off: Array) -> bool:
    """Whether jumps (m,) make more of the acceleration than all that the steps (n,) show beside them."""
    # A jump is one acceleration of its size, and the next of the opposite sign.
    return bool(4.0 * float(np.sum(off**2)) > float(np.sum(np.diff(step) ** 2)))


def _shifts(axis: Axis, share: float) -> bool:
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


def _collapse(axis: Axis, time: Array, place: Array) -> list[Finding]:
    command_time, command = axis.input_time, axis.command
    if command.size < 2:
        return []
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
        return [
            fault(
                "missed_pulses",
                name,
                f"under a constant {axis.command_name} of {value:.4g} the speed of {name} rises to {peak:.4g} {unit}/s"
                f" and then falls to {left * peak:.4g} {unit}/s: above some speed pulses of the encoder are missed",
                "count the pulses in hardware, or drive slower",
                evidence={"peak": peak, "end": left * peak},
                spoils=("identification",),
                places=[(float(grid[top]), float(grid[-1]))],
            )
        ]
    return []
