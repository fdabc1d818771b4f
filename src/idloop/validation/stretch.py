"""The stretches of a record with the largest model error, and the operating state in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.arrays import Array, Mask
from idloop.validation.operating_state import OperatingState
from idloop.validation.words import beside, percent, short

# Length of the window that smooths the squared error, as a share of the record, and at least in samples.
_WINDOW_SHARE, _WINDOW_SAMPLES = 1.0 / 250.0, 5
# A stretch extends while the smoothed squared error exceeds this share of its peak,
_DEPTH = 0.25
# at most over this share of the record,
_LONGEST = 0.1
# and not across a gap of so many median steps.
_HOLE = 5.0
# A stretch is notable with so many times its share of the error, and so much of the error.
_DENSER, _WORTH = 2.0, 0.01


@dataclass(frozen=True)
class Stretch:
    """Part of a record."""

    # On the record's own axis [s]
    start: float
    stop: float
    # Absolute stamps [ns]
    start_ns: int
    stop_ns: int
    # Share of the squared error and of the samples
    error: float
    time: float
    rms: float  # root mean square error in it
    text: str  # operating state

    @property
    def stands_out(self) -> bool:
        """Whether the mean square error clearly exceeds that of the record."""
        return self.error >= max(_DENSER * self.time, self.time + _WORTH)

    def line(self) -> str:
        """Return one line of text."""
        return (
            f"{self.start:.3f} .. {self.stop:.3f} s (stamp {stamp(self.start_ns)}): {percent(self.error)} of the error"
            f" in {percent(self.time)} of the time; {self.text}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        own = {key: getattr(self, key) for key in ("start", "stop", "error", "time", "rms", "text")}
        return own | {"start_stamp": stamp(self.start_ns), "stop_stamp": stamp(self.stop_ns)}


def stamp(nanoseconds: int) -> str:
    """Write an absolute stamp as ROS does: seconds and nine digits."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return f"{seconds}.{rest:09d}"


def worst_stretches(error: Array, state: OperatingState, start_ns: int, most: int = 5) -> tuple[Stretch, ...]:
    """Find the stretches with the largest mean square error, the largest share of the error first.

    `error` (n,): finite, at the instants of `state`; `state`: operating state at the same instants; `start_ns`:
    absolute stamp of time 0 [ns]; `most`: largest number of stretches. Returns: disjoint; none where there is no error.
    """
    n = len(error)
    size = float(np.max(np.abs(error), initial=0.0))
    if n < 2 or size <= 0.0:
        return ()
    square = (error / size) ** 2
    window = min(max(int(n * _WINDOW_SHARE), _WINDOW_SAMPLES), n)
    area = np.concatenate([[0.0], np.cumsum(square)])
    half = window // 2
    low, high = np.maximum(np.arange(n) - half, 0), np.minimum(np.arange(n) + half + 1, n)
    density = (area[high] - area[low]) / (high - low)
    free = np.ones(n, dtype=bool)
    longest = max(int(_LONGEST * n), window)
    steps = np.diff(state.time)
    joined = steps <= _HOLE * np.median(steps)
    found: list[Stretch] = []
    for _ in range(most):
        peak = int(np.argmax(np.where(free, density, -1.0)))
        if not free[peak] or density[peak] <= 0.0:
            break
        first, last = _reach(density, free, joined, peak, longest)
        # The smoothing window extends a stretch by half its length to either side.
        free[max(first - half, 0) : last + 1 + half] = False
        share = float(np.sum(square[first : last + 1])) / float(area[-1])
        start, stop = float(state.time[first]), float(state.time[last])
        stamps = start_ns + round(start * 1e9), start_ns + round(stop * 1e9)
        rms = size * float(np.sqrt(np.mean(square[first : last + 1])))
        text = describe(state, first, last)
        found.append(Stretch(start, stop, *stamps, share, (last + 1 - first) / n, rms, text))
    return tuple(sorted(found, key=lambda s: -s.error))


def _reach(density: Array, free: Mask, joined: Mask, peak: int, longest: int) -> tuple[int, int]:
    """First and last sample of the stretch around a peak."""
    inside = free & (density >= _DEPTH * density[peak])
    first = last = peak
    while last + 1 - first < longest:
        before = first > 0 and inside[first - 1] and joined[first - 1]
        after = last + 1 < len(inside) and inside[last + 1] and joined[last]
        if not before and not after:
            break
        # Towards the denser side first, in case the longest stretch is reached.
        if before and (not after or density[first - 1] >= density[last + 1]):
            first -= 1
        else:
            last += 1
    return first, last


def describe(state: OperatingState, first: int, last: int) -> str:
    """Describe the operating state between two samples. `first`, `last`: samples, the last included."""
    part = slice(first, last + 1)
    words = []
    if state.direction is not None and state.velocity is not None and state.since is not None:
        words.append(_motion(state, part))
    if state.position is not None:
        low, high = float(np.min(state.position[part])), float(np.max(state.position[part]))
        words.append(f"position {_span(low, high)} {state.position_unit}")
    command = state.command[part]
    words.append(f"command {_span(float(np.min(command)), float(np.max(command)))} {state.command_unit}")
    return ", ".join(words)


def _motion(state: OperatingState, part: slice) -> str:
    """Direction, speed and whether it changes."""
    direction, velocity, since = (np.asarray(a)[part] for a in (state.direction, state.velocity, state.since))
    seen = direction[direction != 0.0]
    unit = f"{state.position_unit}/s"
    low, high = float(np.min(velocity)), float(np.max(velocity))
    if len(seen) < 0.1 * len(direction):
        return "standing"
    turns = int(np.sum(np.diff(seen) != 0.0))
    if turns > 1:
        return f"{turns} reversals, velocity {_span(low, high)} {unit}"
    if turns == 1:
        there, back = ("forward", "backward") if seen[0] > 0.0 else ("backward", "forward")
        return f"reversing from {there} to {back}, velocity {_span(low, high)} {unit}"
    way = "forward" if seen[0] > 0.0 else "backward"
    speed = np.abs(velocity)
    change = float(speed[-1] - speed[0])
    pace = "speeding up" if change > 0.3 * np.max(speed) else "slowing down" if -change > 0.3 * np.max(speed) else ""
    text = f"moving {way}" + (f" and {pace}" if pace else "") + f", velocity {_span(low, high)} {unit}"
    length = float(state.time[part][-1] - state.time[part][0])
    # A reversal is mentioned when it is at most twice the length of the stretch away.
    if np.isfinite(since[0]) and since[0] <= 2.0 * length:
        text += f", {short(float(since[0]))} s after a reversal"
    return text


def _span(low: float, high: float) -> str:
    """Text of a range; one number where both ends are about equal."""
    if high - low <= 0.02 * max(abs(low), abs(high)):
        return short(0.5 * (low + high))
    scale = max(abs(low), abs(high))
    return f"{beside(low, scale)} to {beside(high, scale)}"
