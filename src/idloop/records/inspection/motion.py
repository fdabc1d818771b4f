"""Whether a measured signal moves, how far, how finely it is resolved, and whether it starts from rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from idloop.arrays import Array
from idloop.records.inspection.values import without_bad_readings
from idloop.records.record import Record

Beginning = Literal["from rest", "late", "moving", "unseen"]

_NOISE_RATIO = 1.3  # von Neumann's ratio var(x) / (var(diff x) / 2) is 1 for white noise and grows with anything slower
ROUNDING = 1e-12  # part of the range below which values are the same but for rounding in their computation
# Shares of the final speed: below the first an axis is at rest at the beginning, at the second it has started, at the
# third it is under way.
_REST, _OFF, _UNDER_WAY = 0.4, 0.15, 0.5
# A first-order axis that starts at once moves at 0.28 of its final speed, on average, until it is under way.
_LATE = 0.15
# Samples in which a step counts as that of the first sample.
_AT_ONCE = 3
_FEWEST = 20
_ABOVE = 10.0  # travel over a window of a position, and speeds, exceed the steps and the noise by this factor
# Share of the third differences, of least size, that gives the noise, and what it has of the mean square of a normal
# variable; lengths of the means of which they are taken, each twice the last, and samples that more than one need.
_KEPT, _SQUARE_OF_KEPT = 0.75, 0.27639
_WIDTHS, _LONG = (1, 2, 4), 64


@dataclass(frozen=True)
class Motion:
    """A measured signal in numbers."""

    count: int  # samples measured (not NaN)
    # In the signal's unit
    minimum: float
    maximum: float
    std: float
    resolution: float  # smallest step between two values that occur; 0 when constant
    moves: bool  # whether it is more than noise around one value
    # How often the direction of motion changes: swings of a position, sign changes of a velocity, each of more than 2 %
    # of its range
    reversals: int
    infinite: int  # infinite samples


def analyse_motion(value: Array, *, velocity: bool = False) -> Motion | None:
    """Describe one measured position, or velocity, of shape (n,); None when it is never measured.

    Readings far outside of all others are left out: one of them would hide the motion.
    """
    infinite = int(np.isinf(value).sum())
    known = value[np.isfinite(value)]
    known = known[np.isfinite(without_bad_readings(known))]
    if known.size == 0:
        return None
    levels = np.unique(known)
    gaps = np.diff(levels)
    # One level may come in several ways that differ in the last digits.
    gaps = gaps[gaps > ROUNDING * (levels[-1] - levels[0])]
    resolution = float(gaps.min()) if gaps.size else 0.0
    noise = 0.5 * float(np.mean(np.diff(known) ** 2)) if known.size > 1 else 0.0
    moves = levels.size > 1 and bool(np.var(known) > _NOISE_RATIO * noise)
    return Motion(
        count=int(known.size),
        minimum=float(levels[0]),
        maximum=float(levels[-1]),
        std=float(np.std(known)),
        resolution=resolution,
        moves=moves,
        reversals=0 if not moves else sign_changes(known, noise**0.5) if velocity else reversals(known),
        infinite=infinite,
    )


def white_noise(value: Array) -> float:
    """Standard deviation of the white noise in a signal (n,): third differences leave little else, jumps do nothing.

    Of means over more samples the noise is the same per sample, while motion adds to it at any of these lengths, and
    so does a velocity that is a difference of counts, at short ones: the least is the white noise. Rounding of a motion
    that passes a step in few samples counts as the white noise that it is.
    """
    found, sums = [], value
    for width in [one for one in _WIDTHS if one == 1 or value.size >= _LONG * one]:
        sums = sums[width // 2 :] + sums[: -width // 2] if width > 1 else sums
        differences = sums
        for _ in range(3):
            differences = differences[width:] - differences[:-width]
        found.append(_trimmed_square(differences) / (20.0 * width))
    return float(min(found) ** 0.5)


def _trimmed_square(value: Array) -> float:
    """Variance of a normal variable (n,) around 0 from its smallest values, which no single large ones change.

    Where the values are steps of a sensor, a median would be one of a few steps, and this is not.
    """
    if not value.size:
        return 0.0
    square = np.sort(value**2)
    kept = _KEPT * value.size
    whole = min(int(kept), value.size - 1)
    mean = (float(square[:whole].sum()) + (kept - whole) * float(square[whole])) / value.size
    return mean / _SQUARE_OF_KEPT


def sign_changes(velocity: Array, noise: float) -> int:
    """Count how often a velocity (n,) changes its sign beyond its noise, of which the standard deviation is given."""
    sure = velocity[np.abs(velocity) > max(0.02 * float(np.ptp(velocity)), 3.0 * noise)]
    return int(np.count_nonzero(np.diff(np.sign(sure))))


def reversals(position: Array) -> int:
    """Count the turning points of a signal (n,); swings below 2 % of its range do not count."""
    threshold = 0.02 * float(np.ptp(position))
    # Only turning points can be extremes; looking at those alone keeps the loop short.
    step = np.sign(np.diff(position))
    turning = np.flatnonzero(step[1:] * step[:-1] <= 0) + 1
    path = position[np.concatenate([[0], turning, [position.size - 1]])]
    count, direction, extreme = 0, 0, path[0]
    for value in path.tolist():
        if direction >= 0 and value < extreme - threshold:
            count += direction > 0
            direction, extreme = -1, value
        elif direction <= 0 and value > extreme + threshold:
            count += direction < 0
            direction, extreme = 1, value
        elif (direction > 0 and value > extreme) or (direction < 0 and value < extreme):
            extreme = value
    return int(count)


def beginning(time: Array, value: Array, *, velocity: bool) -> tuple[Beginning, float]:
    """Whether a motion under a constant command starts from rest with the record, and when it starts.

    Before such a record the axis stood still without a command. The response shows a gain and a time constant, as a
    record with the step in it does; how much of one level a dead zone or friction takes, it does not show.

    `time` (n,): stamps [s].
    `value` (n,): measured position or velocity; NaN where not measured.
    `velocity`: which of the two.
    Returns `beginning`: from rest at the first sample; at rest for some time first; moving already; or not known.
    and `off`: stamp at which it starts [s]; NaN where it is not at rest first.
    """
    motion, known = analyse_motion(value, velocity=velocity), np.isfinite(value)
    when, what = time[known], value[known]
    # A motion that reverses under a constant command has another cause.
    if when.size < _FEWEST or motion is None or not motion.moves or motion.reversals:
        return "unseen", np.nan
    half, step = when.size // 2, _ABOVE * max(motion.resolution, white_noise(what))
    if velocity:
        end = float(np.median(what[half:]))
        if abs(end) < step:
            return "unseen", np.nan
        over, speed = 0, what / end
        place = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(when))])
    else:
        end = float(what[-1] - what[half]) / float(when[-1] - when[half])
        travel = abs(end) * float(when[-1] - when[0])
        if travel < 4.0 * step:
            return "unseen", np.nan
        over, place = max(int(np.ceil(step / travel * when.size)), 1), (what - what[0]) / end
        speed = (place[over:] - place[:-over]) / (when[over:] - when[:-over])
    if speed[0] > _REST:
        return "moving", np.nan
    under_way = int(np.argmax(speed > _UNDER_WAY))
    still = np.flatnonzero(speed[:under_way] <= _OFF)
    off = int(still[-1]) + over + 1 if still.size else 0
    last = under_way + over
    late = under_way > _AT_ONCE and place[last] < _LATE * (when[last] - when[0])
    return "late" if late else "from rest", float(when[off])


def beginnings(record: Record) -> dict[Beginning, float]:
    """How the measured motions of a record begin, and when the first of each kind starts [s]."""
    found: dict[Beginning, float] = {}
    for name, column in zip(record.output_names, record.output.T, strict=True):
        field = name.rpartition(".")[2]
        if field in ("position", "velocity"):
            how, off = beginning(record.time, column, velocity=field == "velocity")
            found[how] = min(off, found.get(how, np.inf))
    return found
