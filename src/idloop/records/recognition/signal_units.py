"""Units that a log does not write down, by what the signals have to do with each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Literal

import numpy as np

from idloop.arrays import Array
from idloop.records.inspection.motion import white_noise
from idloop.records.inspection.velocity_check import breaks, velocity_slope
from idloop.records.tables.base_units import SECONDS, base_unit
from idloop.records.tables.mapping import Decoding, SignBit
from idloop.records.tables.signals import sign_magnitude, twos_complement

# Units of unwritten ones, the most usual first.
_ROTARY, _ROTARY_SPEEDS = ("rad", "deg", "rev"), ("rad/s", "rpm", "deg/s", "rev/s")
_LINEAR, _LINEAR_SPEEDS = ("m", "mm", "cm"), ("m/s", "mm/s", "cm/s")
_AGREES, _BADLY = 0.04, 1.25
# A column runs with the slope of a position from this correlation on, over windows in which it moves by so many times
# its noise and its step; samples at least, and windows side by side.
_RUNS_WITH, _ABOVE, _FEWEST, _WINDOWS = 0.97, 5.0, 50, 16
_MOST = 100_000  # increments of a long record that are compared
# Ranges after which positions start again: a turn in each unit, encoders of 8 to 24 bits.
_TURNS = {"rad": 2.0 * pi, "deg": 360.0, "rev": 1.0}
_COUNTS = tuple(float(2**bits) for bits in range(8, 25))
# Steps of an encoder in an angle: as many at least, each as far off a multiple at most, and a turn of them.
_FEWEST_STEPS, _OFF_STEP, _FEWEST_PER_TURN, _SAME_TURN = 20, 0.02, 64, 1e-4
_DIGITS = 2  # other than zeros of a round number of steps in a turn
_SAME_COUNT = 0.003  # difference of a measured number of counts per turn and that of the encoder
_LARGEST_STEP = 0.25  # of the range, but for a wrap
# An axis that goes round passes all of its range, by less than this part of it between two samples; without its wraps
# its steps scatter by so much less, and so many of them show it.
_MIDDLE, _NEXT, _SMOOTHER, _FEWEST_WRAPS = 0.25, 0.45, 0.3, 3
# A register with a sign has ten bits or more. Where the sign changes, the signal with it jumps by less than this share
# of what it does without, and is within this share of its largest value.
_FEWEST_BITS, _FEWEST_LEVELS, _FEWEST_PASSES = 10, 4, 3
_RUNS_ON, _NEAR_ZERO = 0.6, 0.8


@dataclass(frozen=True)
class MotionUnits:
    """Units of position and velocity, and of time where that was open."""

    position: str
    velocity: str
    time: str
    slope: float  # the velocity over the slope of the position, in these units; NaN where nothing can be said
    agree: bool  # whether it is one, up to the sign


def motion_units(
    time: Array,
    position: Array,
    velocity: Array,
    units: tuple[str, str],
    times: tuple[str, ...],
    *,
    linear: bool,
) -> MotionUnits:
    """Find the units with which a velocity is the slope of a position.

    `time` (n,): stamps in the first of the units `times`, in seconds.
    `units`: of both, where they are written down; empty where not.
    `times`: units of time that are possible, the most probable first.
    """
    places = (units[0],) if units[0] else _LINEAR if linear else _ROTARY
    speeds = (units[1],) if units[1] else _LINEAR_SPEEDS if linear else _ROTARY_SPEEDS
    found = velocity_slope(time, position, velocity)
    raw = float("nan") if found is None or found.unrelated else found.value
    best = MotionUnits(places[0], speeds[0], times[0], raw * _ratio(places[0], speeds[0]), False)
    if not np.isfinite(raw):
        return best
    for unit in times:
        slower = SECONDS[unit] / SECONDS[times[0]] if unit in SECONDS else 1.0
        for place in places:
            for speed in speeds:
                slope = raw * slower * _ratio(place, speed)
                if abs(abs(slope) - 1.0) <= _AGREES:
                    return MotionUnits(place, speed, unit, slope, agree=True)
    return best


@dataclass(frozen=True)
class SlopeOf:
    """A column that runs with the slope of a position."""

    value: float  # its values over that slope
    correlation: float  # of its integral with the increments of the position, without sign


def slope_of(time: Array, position: Array, rate: Array, runs: Sequence[slice] = ()) -> SlopeOf | None:
    """Compare a column with the slope of a position, over the shortest windows in which the motion exceeds the noise.

    Over long windows the integral of a command runs with the position as well. A velocity may be late, as behind a
    filter: its integral lacks the delay times its own increment. A command is never late.

    `time`, `position`, `rate` (n,).
    `runs`: rows within which the time rises; by default all.
    Returns: None where it runs otherwise, or the position hardly moves.
    """
    pieces = []
    for run in runs or [slice(None)]:
        piece = np.array([time[run], position[run], rate[run]])
        piece = piece[:, np.isfinite(piece).all(axis=0)]
        if piece.shape[1] > 1:
            # Tests that follow each other in one file begin at one place, and no rate has made that jump.
            pieces += np.split(piece, np.flatnonzero(breaks(piece[0], piece[1])) + 1, axis=1)
    pieces = [piece for piece in pieces if piece.shape[1] > 1]
    longest = max((piece.shape[1] for piece in pieces), default=0)
    if longest < _FEWEST:
        return None
    where = np.concatenate([piece[1] for piece in pieces])
    steps = np.abs(np.diff(np.unique(where)))
    least = max(white_noise(where), float(steps.min()) if steps.size else np.inf)
    series = [_with_area(*piece) for piece in pieces]
    every = max(where.size // _MOST, 1)
    length, found = 1, None
    while length <= longest // _WINDOWS:
        step = np.concatenate([one[:, length::every] - one[:, :-length:every] for one in series], axis=1)
        moved = float(np.std(step[0]))
        # A coarse motion that exceeds its step nowhere by far is compared over the longest windows.
        if moved > least:
            found = step
        if moved > _ABOVE * least:
            break
        length *= 2
    return None if found is None else _regressed(*found)


def _with_area(time: Array, position: Array, rate: Array) -> Array:
    """Position, integral of the rate, and the rate, shape (3, n)."""
    area = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))
    return np.array([position, np.concatenate([[0.0], area]), rate])


def _regressed(moved: Array, passed: Array, changed: Array) -> SlopeOf | None:
    """Compare increments of a position, of the integral of a rate, and of the rate itself."""
    if not np.std(passed) > 0.0:
        return None
    correlation = abs(float(np.corrcoef(moved, passed)[0, 1]))
    value = float(np.dot(moved, passed) / np.dot(moved, moved))
    table = np.column_stack([moved - moved.mean(), changed - changed.mean()])
    slope, minus_delay = np.linalg.lstsq(table, passed - passed.mean(), rcond=None)[0].tolist()
    if minus_delay < 0.0:
        late = abs(float(np.corrcoef(table @ [slope, minus_delay], passed)[0, 1]))
        if correlation <= _RUNS_WITH < late:
            correlation, value = late, slope
    return SlopeOf(value, correlation) if correlation > _RUNS_WITH and value else None


def near_unit(slope: float) -> bool:
    """Whether a velocity that is this many times the slope in rad or m may be in some unit, badly measured."""
    speeds = (base_unit(unit, "velocity", "")[1] for unit in (*_ROTARY_SPEEDS, *_LINEAR_SPEEDS))
    return any(1.0 / _BADLY < abs(slope) * factor < _BADLY for factor in speeds)


def usual_resolution(counts: float) -> float:
    """Return the counts per turn that an encoder has whose measured ones are given: a power of two, a round number."""
    powers = [float(2**bits) for bits in range(1, 32)]
    rounded = [float(f"{counts:.{digits}g}") for digits in (1, 2, 3)]
    return next((one for one in (*powers, *rounded) if abs(one / counts - 1.0) < _SAME_COUNT), float(f"{counts:.4g}"))


def steps_per_turn(value: Array, unit: str) -> int:
    """Return how many steps of a coarse angle in rad or deg a turn has; 0 where they are no usual part of one."""
    known = value[np.isfinite(value)]
    change = np.abs(np.diff(known))
    change = change[change > 0.0]
    if unit not in _TURNS or change.size < _FEWEST_STEPS:
        return 0
    step = float(np.min(change))
    # The mean over many steps is finer than the digits of one.
    counts = np.round(change / step)
    step = float(np.sum(change) / np.sum(counts))
    if float(np.max(np.abs(change / step - counts))) > _OFF_STEP:
        return 0
    if abs(step / float(f"{step:.2g}") - 1.0) < _SAME_TURN:  # as a number is written, with two digits
        return 0
    turn = _TURNS[unit] / step
    whole = round(turn)
    # Of many steps nearly any number is a multiple of a hundred within the accuracy: more zeros are asked for.
    zeros = max(2, len(str(whole)) - _DIGITS)
    usual = whole >= _FEWEST_PER_TURN and (whole % 10**zeros == 0 or whole.bit_count() == 1)
    return whole if usual and abs(turn / whole - 1.0) < _SAME_TURN else 0


def _ratio(place: str, speed: str) -> float:
    if "counts" in (place, speed):
        return 1.0
    return base_unit(speed, "velocity", "")[1] / base_unit(place, "position", "")[1]


def find_wrap(value: Array, unit: str) -> float:
    """Return the range after which a position starts again, in its unit; 0 where it does not."""
    known = value[np.isfinite(value)]
    if known.size < 3:
        return 0.0
    low, high = float(known.min()), float(known.max())
    step = np.abs(np.diff(known))
    span = high - low
    # The most that an axis moves between two samples is far below a turn; a wrap is nearly a whole one.
    ranges = (_TURNS[unit],) if unit in _TURNS else _COUNTS
    if not unit or unit == "counts":
        ranges = _COUNTS if unit else (*_TURNS.values(), *_COUNTS)
    for whole in ranges:
        if not 0.9 * whole < span <= 1.001 * whole:
            continue
        jumps = step > (1.0 - _LARGEST_STEP) * whole
        others = step[~jumps]
        if jumps.any() and others.size and float(others.max()) < _LARGEST_STEP * whole:
            return whole
        if _goes_round(known - low, whole):
            return whole
    return 0.0


def _goes_round(value: Array, whole: float) -> bool:
    """Whether a position from 0 to a whole range goes round and round, by large parts of it between two samples."""
    step = np.diff(value)
    turned = step - whole * np.round(step / whole)
    middle = float(np.mean(np.abs(value / whole - 0.5) < 0.25))
    return bool(
        np.count_nonzero(step != turned) >= _FEWEST_WRAPS
        and middle > _MIDDLE
        and float(np.abs(turned).max()) < _NEXT * whole
        and float(np.std(np.diff(turned))) < _SMOOTHER * float(np.std(np.diff(step)))
    )


def find_decoding(value: Array) -> Decoding | None:
    """Return how negative numbers were logged as large positive ones, by values (n,); None where they were not.

    In two's complement they lie at the upper end of 16 or 32 bits, with nothing between. With a sign bit they begin at
    a power of two, and the signal jumps by as much wherever it passes zero: with the sign it runs on.
    """
    known = value[np.isfinite(value)]
    if not known.size or known.min() < 0 or known.max() < 2.0**_FEWEST_BITS or (known != np.round(known)).any():
        return None
    two: tuple[tuple[Literal["int16", "int32"], int], ...] = (("int16", 16), ("int32", 32))
    for name, bits in two:
        whole = 2.0**bits
        if known.max() >= whole:
            continue
        high = known >= 0.75 * whole
        low = known < 0.25 * whole
        if high.any() and low.any() and bool((high | low).all()):
            return name
    return _sign_bit(known)


def _sign_bit(known: Array) -> SignBit | None:
    bit = int(known.max()).bit_length() - 1
    signed = sign_magnitude(known, bit)
    high = known >= 2.0**bit
    levels = min(np.unique(known[high]).size, np.unique(known[~high]).size)
    passes = np.flatnonzero(high[1:] != high[:-1])
    if levels < _FEWEST_LEVELS or passes.size < _FEWEST_PASSES:
        return None
    size = np.abs(signed)
    near = float(np.median(np.maximum(size[passes], size[passes + 1])))
    jump, passed = (float(np.abs(np.diff(one))[passes].sum()) for one in (known, signed))
    return SignBit(sign_bit=bit) if passed < _RUNS_ON * jump and near < _NEAR_ZERO * size.max() else None


def decoded(value: Array, kind: Decoding) -> Array:
    """Return values (n,) with the sign that `find_decoding` has found."""
    return sign_magnitude(value, kind.sign_bit) if isinstance(kind, SignBit) else twos_complement(value, kind)
