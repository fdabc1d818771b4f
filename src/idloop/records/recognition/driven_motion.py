"""Which of several motions a command drives: that of a cart, and not that of the pendulum on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from idloop.arrays import Array

_WINDOWS = 400  # over which a position is differentiated
_FEWEST = 40
_AT_REST = 0.02  # of the largest speed, below which dry friction has no sign
# Share of the power of a command that its motion explains at least, and how much less others leave.
_EXPLAINED, _TIMES = 0.3, 2.0


def driven_most(positions: Mapping[str, Array], command: Array, runs: Sequence[slice]) -> str:
    """Name the position whose acceleration, velocity and direction explain a command, where others do far less.

    `positions`: values by name, each shape (n,).
    `command`: shape (n,).
    `runs`: rows within which the time rises.
    Returns: empty where none explains it, or where another explains nearly as much.
    """
    alike = {name: value for name, value in positions.items() if value.size == command.size}
    shares = {
        name: max((_explained(value[run], command[run]) for run in runs), default=0.0) for name, value in alike.items()
    }
    if len(shares) < 2:
        return ""
    best, second = sorted(shares, key=lambda name: shares[name], reverse=True)[:2]
    return best if shares[best] > max(_EXPLAINED, _TIMES * shares[second]) else ""


def _explained(position: Array, command: Array) -> float:
    """Share of the power of the command beside its mean, over windows of rows."""
    known = np.isfinite(position) & np.isfinite(command)
    place, drive = position[known], command[known]
    width = max(place.size // _WINDOWS, 2)
    if place.size < _FEWEST * width or not (np.ptp(place) and np.ptp(drive)):
        return 0.0
    speed = place[width:] - place[:-width]
    gained = speed[width:] - speed[:-width]
    middle = slice(width // 2, width // 2 + gained.size)
    moving = np.tanh(speed[middle] / (_AT_REST * float(np.abs(speed).max())))
    # Each command acts within the two windows between the three means of the position.
    summed = np.convolve(drive, np.full(width, 1.0 / width), mode="same")[width : width + gained.size]
    table = np.column_stack([gained, speed[middle], moving, np.ones(gained.size)])
    table /= np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    left = summed - table @ np.linalg.lstsq(table, summed, rcond=1e-10)[0]
    power = float(np.var(summed))
    return 1.0 - float(np.var(left)) / power if power > 0.0 else 0.0
