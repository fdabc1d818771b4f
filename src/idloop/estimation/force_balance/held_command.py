"""A command that is held from its stamp until the next one, averaged around the instants of a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Change within a sample, as a part of the command's rms, above which it counts as a jump; else the mean is used.
_JUMP = 0.1
# Parts of a sample time for which a measured signal is held: the steps are off a curve by 1 in 400.
_PARTS = 4


def held_along(time: Array, value: Array) -> tuple[Array, Array]:
    """A measured signal as a command that is held for parts of its sample time, on a spline through the samples.

    Parameters
    ----------
    time, value : array, shape (m,)
        Increasing instants of the samples [s], and the signal.

    Returns
    -------
    time, value : array, shape (k,)
        Stamps [s] and held values: the spline in the middle of each part.
    """
    from scipy.interpolate import CubicSpline

    if len(time) < 4:
        return time, value
    place = np.arange((len(time) - 1) * _PARTS + 1) / _PARTS
    middle = np.interp(place, np.arange(len(time)), time)
    edges = np.concatenate([[1.5 * middle[0] - 0.5 * middle[1]], 0.5 * (middle[1:] + middle[:-1])])
    return edges, np.asarray(CubicSpline(time, value)(middle))


class Weight(Enum):
    """By what a force counts around an instant of the motion."""

    SAMPLE = 0  # one sample time, for a motion that is filtered
    VELOCITY = 1  # two sample times, as in the central difference of a velocity
    POSITION = 2  # a triangle of two sample times, as in the second difference of a position


@dataclass(frozen=True)
class CommandAround:
    """A command around each of n instants.

    Attributes
    ----------
    mean : array, shape (n,)
        By the `Weight` of the motion.
    jumps : array of int, shape (k,)
        Instants around which it jumps within half a sample time.
    before, after : array, shape (k,)
        Values on both sides of the jump.
    late : array, shape (k,)
        Part of the mean after the jump.
    """

    mean: Array
    jumps: NDArray[np.int64]
    before: Array
    after: Array
    late: Array

    @classmethod
    def joined(cls, parts: Sequence[CommandAround]) -> CommandAround:
        """Several of them, concatenated."""
        starts = np.cumsum([0, *(len(part.mean) for part in parts[:-1])])
        return cls(
            np.concatenate([part.mean for part in parts]),
            np.concatenate([part.jumps + start for part, start in zip(parts, starts, strict=True)]),
            np.concatenate([part.before for part in parts]),
            np.concatenate([part.after for part in parts]),
            np.concatenate([part.late for part in parts]),
        )


class HeldCommand:
    """A command that is held from each stamp to the next.

    Parameters
    ----------
    time, value : array, shape (m,)
        Stamps [s] and commands; before the first the command is 0.
    """

    def __init__(self, time: Array, value: Array) -> None:
        self._time, self._given = time, value
        self._starts = np.concatenate([[-np.inf], time])
        self._value = np.concatenate([[0.0], value])
        self._rms = float(np.sqrt(np.mean(value**2)))

    def reversed(self) -> HeldCommand:
        """The command with the opposite sign."""
        return HeldCommand(self._time, -self._given)

    def around(self, time: Array, sample_time: float, weight: Weight = Weight.SAMPLE) -> CommandAround:
        """The command around each instant of ``time`` (n,) [s], of a motion with some sample time [s]."""
        mean, before, after = _around(self._starts, self._value, time, sample_time, weight.value)
        change = after - before
        jumps = np.flatnonzero(np.abs(change) > _JUMP * self._rms)
        late = (mean[jumps] - before[jumps]) / change[jumps]
        inside = (late >= 0.0) & (late <= 1.0)
        jumps = jumps[inside]
        return CommandAround(mean, jumps, before[jumps], after[jumps], late[inside])


@njit(cache=True, nogil=True, error_model="numpy")
def _share(place: float, weight: int) -> float:
    """Part of the weight before a place [sample times from the instant]."""
    if weight == 0:
        return min(max(0.5 + place, 0.0), 1.0)
    place = min(max(place, -1.0), 1.0)
    if weight == 1:
        return 0.5 * (1.0 + place)
    return 0.5 * (1.0 + place) ** 2 if place < 0.0 else 1.0 - 0.5 * (1.0 - place) ** 2


@njit(cache=True, nogil=True, error_model="numpy")
def _around(starts: Array, value: Array, time: Array, sample_time: float, weight: int) -> tuple[Array, Array, Array]:
    """Weighted mean of a held value around each instant, and its values half a sample time before and after it."""
    mean, ends = np.zeros(len(time)), np.empty((2, len(time)))
    # Instants increase: each search begins at the previous one.
    first = 0
    for k in range(len(time)):
        while first > 0 and starts[first] > time[k] - sample_time:
            first -= 1
        while first < len(value) - 1 and starts[first + 1] <= time[k] - sample_time:
            first += 1
        known, end, place = 0.0, -1.0, first
        ends[:, k] = value[first]
        while end < 1.0:
            for side in range(2):
                if end <= side - 0.5:
                    ends[side, k] = value[place]
            end = 1.0 if place == len(value) - 1 else (starts[place + 1] - time[k]) / sample_time
            until = _share(end, weight)
            mean[k] += (until - known) * value[place]
            known, place = until, place + 1
    return mean, ends[0], ends[1]
