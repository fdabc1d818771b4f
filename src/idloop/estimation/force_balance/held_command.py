"""A command that is held from its stamp until the next one, averaged around the instants of a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Time for which the last command is held, and for which there is none before the first [s].
_BEYOND, _BEFORE = 10.0, 1e3
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


@dataclass(frozen=True)
class CommandAround:
    """A command over one sample time around each of n instants.

    Attributes
    ----------
    mean : array, shape (n,)
    jumps : array of int, shape (k,)
        Instants around which it jumps once.
    before, after : array, shape (k,)
        Values on both sides of the jump.
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
    """A command with its integral, from which the mean over any interval follows exactly.

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

    def reversed(self) -> HeldCommand:
        """The command with the opposite sign."""
        return HeldCommand(self._time, -self._given, self._end)

    def around(self, time: Array, sample_time: float) -> CommandAround:
        """The command over one sample time [s] around each instant of ``time`` (n,) [s]."""
        mean, before, after = _around(self._edges, self._area, self._value, time, sample_time)
        change = after - before
        jumps = np.flatnonzero(np.abs(change) > _JUMP * self._rms)
        late = (mean[jumps] - before[jumps]) / change[jumps]
        inside = (late >= 0.0) & (late <= 1.0)
        jumps = jumps[inside]
        return CommandAround(mean, jumps, before[jumps], after[jumps], late[inside])


@njit(cache=True, nogil=True, error_model="numpy")
def _around(edges: Array, area: Array, value: Array, time: Array, sample_time: float) -> tuple[Array, Array, Array]:
    """Mean of a held value over one sample time around each instant, and its values at the beginning and the end."""
    ends = np.empty((2, len(time)))
    areas = np.empty((2, len(time)))
    for side in range(2):
        offset = (side - 0.5) * sample_time
        # Instants increase: each search begins at the previous one.
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
