"""A command that is held from its stamp until the next one, around the instants of a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The last command is held so long beyond the last measurement, and none was given so long before the first [s].
_BEYOND, _BEFORE = 10.0, 1e3
# A change by this part of the command's rms within a sample is taken as a jump: below, its mean serves.
_JUMP = 0.1

# A measured signal is held in so many parts of its sample time: what is left of the steps is 1 in 400 of a curve.
_PARTS = 4


def held_along(time: Array, value: Array) -> tuple[Array, Array]:
    """A measured signal as a command that is held for parts of its sample time, on a smooth curve through the samples.

    Parameters
    ----------
    time, value : array, shape (m,)
        Instants of the samples [s], rising, and the signal.

    Returns
    -------
    time, value : array, shape (k,)
        Stamps [s] and what is held from there on: the curve in the middle of each part.
    """
    from scipy.interpolate import CubicSpline

    if len(time) < 4:
        return time, value
    place = np.arange((len(time) - 1) * _PARTS + 1) / _PARTS
    middle = np.interp(place, np.arange(len(time)), time)
    edges = np.concatenate([[1.5 * middle[0] - 0.5 * middle[1]], 0.5 * (middle[1:] + middle[:-1])])
    return edges, np.asarray(CubicSpline(time, value)(middle))


@dataclass(frozen=True)
class CommandAround:
    """A command over one sample time around each of n instants.

    Attributes
    ----------
    mean : array, shape (n,)
    jumps : array of int, shape (k,)
        Instants around which it jumps once.
    before, after : array, shape (k,)
        What it is on either side.
    late : array, shape (k,)
        Part of the sample time after the jump.
    """

    mean: Array
    jumps: NDArray[np.int64]
    before: Array
    after: Array
    late: Array

    @classmethod
    def joined(cls, parts: Sequence[CommandAround]) -> CommandAround:
        """One after the other."""
        starts = np.cumsum([0, *(len(part.mean) for part in parts[:-1])])
        return cls(
            np.concatenate([part.mean for part in parts]),
            np.concatenate([part.jumps + start for part, start in zip(parts, starts, strict=True)]),
            np.concatenate([part.before for part in parts]),
            np.concatenate([part.after for part in parts]),
            np.concatenate([part.late for part in parts]),
        )


class HeldCommand:
    """A command, with its integral, from which its mean over any time follows exactly.

    Parameters
    ----------
    time, value : array, shape (m,)
        Stamps [s] and commands; before the first the command is 0.
    end : float
        Last instant of the measurement [s].
    """

    def __init__(self, time: Array, value: Array, end: float) -> None:
        self._time, self._given, self._end = time, value, end
        edges = np.concatenate([time, [max(end, float(time[-1])) + _BEYOND]])
        area = np.concatenate([[0.0], np.cumsum(value * np.diff(edges))])
        self._edges = np.concatenate([[edges[0] - _BEFORE], edges])
        self._area = np.concatenate([[0.0], area])
        self._value = np.concatenate([[0.0], value])
        self._rms = float(np.sqrt(np.mean(value**2)))

    def turned(self) -> HeldCommand:
        """With the other sign."""
        return HeldCommand(self._time, -self._given, self._end)

    def around(self, time: Array, sample_time: float) -> CommandAround:
        """The command over one sample time around each instant.

        Parameters
        ----------
        time : array, shape (n,)
            [s]
        sample_time : float
            [s]
        """
        mean, before, after = _around(self._edges, self._area, self._value, time, sample_time)
        change = after - before
        jumps = np.flatnonzero(np.abs(change) > _JUMP * self._rms)
        late = (mean[jumps] - before[jumps]) / change[jumps]
        inside = (late >= 0.0) & (late <= 1.0)
        jumps = jumps[inside]
        return CommandAround(mean, jumps, before[jumps], after[jumps], late[inside])


@njit(cache=True, nogil=True, error_model="numpy")
def _around(edges: Array, area: Array, value: Array, time: Array, sample_time: float) -> tuple[Array, Array, Array]:
    """Mean of a held value over one sample time around each instant, and what it is at the beginning and at the end."""
    ends = np.empty((2, len(time)))
    areas = np.empty((2, len(time)))
    for side in range(2):
        offset = (side - 0.5) * sample_time
        # Instants rise: each is found from the one before it.
        place = max(np.searchsorted(edges, time[0] + offset, side="right") - 1, 0) if len(time) else 0
        for k in range(len(time)):
            instant = time[k] + offset
            while place > 0 and edges[place] > instant:
                place -= 1
            while place < len(value) - 1 and edges[place + 1] <= instant:
                place += 1
            ends[side, k] = value[place]
            areas[side, k] = area[place] + value[place] * (instant - edges[place])
    return (areas[1] - areas[0]) / sample_time, ends[0], ends[1]
