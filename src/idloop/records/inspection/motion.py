"""Whether a measured signal moves, how far and how finely it is resolved."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# von Neumann's ratio var(x) / (var(diff x) / 2) is 1 for white noise and grows with anything slower.
_NOISE_RATIO = 1.3
# Part of the range below which values are the same but for rounding in their computation.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Motion:
    """A measured signal in numbers.

    Attributes
    ----------
    count : int
        Samples measured (not NaN).
    minimum, maximum, std : float
        In the signal's unit.
    resolution : float
        Smallest step between two values that occur; 0 when constant.
    moves : bool
        Whether it does more than noise about one value.
    reversals : int
        How often the direction of motion changes: swings of a position, sign changes of a velocity, each of more
        than 2 % of its range.
    infinite : int
        Infinite samples.
    """

    count: int
    minimum: float
    maximum: float
    std: float
    resolution: float
    moves: bool
    reversals: int
    infinite: int

    def to_dict(self) -> dict[str, object]:
        """Return plain values for JSON."""
        return asdict(self)


def analyse_motion(value: Floats, *, velocity: bool = False) -> Motion | None:
    """Describe one measured position, or velocity, of shape (n,); None when it is never measured."""
    infinite = int(np.isinf(value).sum())
    known = value[np.isfinite(value)]
    if known.size == 0:
        return None
    levels = np.unique(known)
    gaps = np.diff(levels)
    # One level may come in several ways that differ in the last digits.
    gaps = gaps[gaps > _ROUNDING * (levels[-1] - levels[0])]
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


def white_noise(value: Floats) -> float:
    """Standard deviation of the white noise in a signal (n,): third differences leave little else, jumps do nothing."""
    return float(1.4826 / np.sqrt(20.0) * np.median(np.abs(np.diff(value, 3))))


def sign_changes(velocity: Floats, noise: float) -> int:
    """Count how often a velocity (n,) changes its sign beyond its noise, of which the standard deviation is given."""
    sure = velocity[np.abs(velocity) > max(0.02 * float(np.ptp(velocity)), 3.0 * noise)]
    return int(np.count_nonzero(np.diff(np.sign(sure))))


def reversals(position: Floats) -> int:
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
