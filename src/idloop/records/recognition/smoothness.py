"""Which of several signals changes first: a motion is its command with the fast changes taken out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from idloop.arrays import Array
from idloop.records.inspection.motion import white_noise

_FEWEST_ROWS = 10  # that show noise
_TINY = 1e-9  # share of the variance that is no change
_COARSE = 0.3  # of the range, for the steps of a sensor


def smoothest_first(signals: Sequence[tuple[Array, Sequence[slice]]]) -> list[int]:
    """Order signals by how soon they change.

    Changes are compared at lags from one row to a sixteenth of the record, each as a share of the spread and above what
    noise and quantisation may do to any of the signals.

    `signals`: sequence of (array, sequence of slice). Values, shape (n,), that are not all equal, and the rows of each
    run.
    Returns: places in the sequence, the smoothest first.
    """
    made = [change_by_noise(value) for value, _ in signals]
    noise = max(largest for largest, _ in made)
    changes = [
        np.maximum(_changes(value, runs) - flicker, 0.0)
        for (value, runs), (_, flicker) in zip(signals, made, strict=True)
    ]
    common = min(map(len, changes))
    roughness = [float(np.log(one[:common] + noise + _TINY).sum()) for one in changes]
    return sorted(range(len(signals)), key=lambda place: roughness[place])


def change_by_noise(value: Array) -> tuple[float, float]:
    """Mean square of the change that noise or quantisation make at most, and that a coarse sensor's flicker makes.

    `value` (n,): not all equal. Both are shares of the variance.
    """
    known = value[np.isfinite(value)]
    step, variance = float(np.diff(np.unique(known)).min()), float(np.var(known))
    white = 2.0 * white_noise(known) ** 2 if known.size > _FEWEST_ROWS else 0.0
    flicker = 0.0
    # Where there are fewer levels, each of them may be meant.
    if step < _COARSE * np.ptp(known):
        change = np.diff(known)
        change = change[change != 0.0]
        # By one step, and back by the next change.
        back = (np.abs(change[1:]) < 1.5 * step) & (np.abs(change[:-1] + change[1:]) < 0.5 * step)
        flicker = float(np.count_nonzero(back)) * step**2 / known.size
    return max(white, 0.5 * step**2) / variance, flicker / variance


def _changes(value: Array, runs: Sequence[slice]) -> Array:
    """Mean squares of the change at lags of a sixteenth of the longest run and less, as shares of the variance."""
    pieces = [value[run] for run in runs]
    pieces = [piece[np.isfinite(piece)] for piece in pieces]
    count = max(piece.size for piece in pieces)
    squares = []
    for halved in range(min(4, count.bit_length() - 1), count.bit_length()):
        lag = count >> halved
        squares.append(np.mean(np.concatenate([np.square(piece[lag:] - piece[:-lag]) for piece in pieces])))
    return np.array(squares) / float(np.nanvar(value))
