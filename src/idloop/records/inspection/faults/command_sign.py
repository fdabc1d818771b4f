"""A command that lost its sign: never negative, although it drives the axis both ways.

Under a load or a spring an axis goes back where the command is small; where the sign was lost, it goes back the faster
the larger the command is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault

Floats = NDArray[np.float64]

# Correlation of speed and command in both directions, and its standard errors.
_RELATED, _ERRORS = 0.4, 4.0
# Share of the travel that goes the other way.
_BACK = 0.1
_WINDOWS, _FEWEST, _PARTS = (3, 9, 27, 81), 12, 8


def check(axis: Axis) -> list[Finding]:
    """Correlate speed and command in each direction of motion."""
    grid = axis.grid
    if grid is None or axis.command.size < 2:
        return []
    known = axis.command[np.isfinite(axis.command)]
    low, high = float(known.min()), float(known.max())
    if low == high or low * high < 0.0:
        return []
    size, speed = np.abs(grid.command), grid.speed
    good = np.isfinite(size) & np.isfinite(speed)
    size, speed = size[good], speed[good]
    travel = np.array([np.sum(speed[speed > 0.0]), -np.sum(speed[speed < 0.0])])
    if size.size < 200 or travel.min() < _BACK * travel.max():
        return []
    found = max((_both_ways(size, speed, width, grid.noise) for width in _WINDOWS), key=min)
    if min(found) < _RELATED:
        return []
    still = float(np.mean(np.abs(speed[size == 0.0]) < 0.05 * np.max(np.abs(speed)))) if np.any(size == 0.0) else np.nan
    at_rest = f", and stands still in {100 * still:.0f} % of the time at zero" if np.isfinite(still) else ""
    back = float(travel.min() / travel.sum())
    name = axis.command_name
    return [
        fault(
            "sign_lost",
            name,
            f"{name} is never {'negative' if high > 0.0 else 'positive'}, but the axis goes both ways, the faster the"
            f" larger it is (correlation {found[0]:.2f} forwards and {found[1]:.2f} backwards; {100 * back:.0f} % of"
            f" the travel backwards){at_rest}: its sign was not recorded",
            "record the command with its sign, or give the sign by the direction pin or the sign of the control error"
            " before the import",
            evidence={"forwards": found[0], "backwards": found[1], "backward_travel": back},
            spoils=("identification",),
        )
    ]


def _both_ways(size: Floats, speed: Floats, width: int, noise: float) -> tuple[float, float]:
    """Correlation of speed and command over windows, forwards and backwards; -1 where it is not certain."""
    count = size.size // width
    size, speed = (one[: count * width].reshape(count, width).mean(axis=1) for one in (size, speed))
    rest = max(3.0 * noise / width**0.5, 0.02 * float(np.max(np.abs(speed), initial=0.0)))
    return tuple(  # type: ignore[return-value]
        _certain(size[rows], np.abs(speed[rows])) for rows in (speed > -rest, speed < rest)
    )


def _certain(size: Floats, speed: Floats) -> float:
    if size.size < _FEWEST or np.std(size) == 0.0 or np.std(speed) == 0.0:
        return -1.0
    parts = min(_PARTS, size.size // 4)
    which = np.arange(size.size) * parts // size.size
    each = [float(np.corrcoef(size[which != k], speed[which != k])[0, 1]) for k in range(parts)]
    whole, error = float(np.corrcoef(size, speed)[0, 1]), float(np.sqrt((parts - 1.0) * np.var(each)))
    return whole if np.isfinite(whole) and np.isfinite(error) and whole > _ERRORS * error else -1.0
