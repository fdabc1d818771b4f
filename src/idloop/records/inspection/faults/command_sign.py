"""A command that lost its sign: never negative, although it drives the axis both ways.

A load that is larger than friction keeps the sign of the command: it has another level in each direction, and goes
through no zero between them. Under a smaller one, or a spring, an axis goes back where the command is small. Where the
sign was lost, it goes back the faster the larger the command is; and where the inertia counts, the force that the
motion needs has the size of the command with either sign.
"""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import responses

# Evidence that a command may have lost its sign, or has: share of the travel that goes the other way.
BACKWARD_TRAVEL = "backward_travel"
# Correlation of speed and command in both directions, and its standard errors.
_RELATED, _ERRORS = 0.4, 4.0
# Share of the travel that goes the other way.
_BACK = 0.1
# A load: the least command in the median, and the difference of its levels in what each of them varies by.
_LEAST, _APART = 0.3, 1.0
_WINDOWS, _FEWEST, _PARTS = (3, 9, 27, 81), 12, 8
# Acceleration left by a command with a free sign: at most the first share, and the second of what the command leaves
# that is shifted in time, or that is taken as it is.
_LEFT, _CLEARER = 0.3, 0.55
_SHIFTS, _TURNS = 8, 12


def check(axis: Axis) -> list[Finding]:
    """Correlate speed and command in each direction of motion."""
    grid, back = axis.grid, backward_travel(axis)
    if grid is None or not back:
        return []
    size, speed = np.abs(grid.command), grid.speed
    good = np.isfinite(size) & np.isfinite(speed)
    size, speed = size[good], speed[good]
    high = float(np.nanmax(axis.command))
    static = max((_both_ways(size, speed, width, grid.noise) for width in _WINDOWS), key=min)
    explained, plain = _with_sign(axis)
    if min(static) >= _RELATED:
        why = f"the faster the larger it is (correlation {static[0]:.2f} forwards and {static[1]:.2f} backwards)"
    elif explained > 0.0:
        why = (
            f"with a sign of its own at each instant it explains {100 * explained:.0f} % of the acceleration, as it is"
            f" {100 * plain:.0f} %"
        )
    else:
        return []
    still = float(np.mean(np.abs(speed[size == 0.0]) < 0.05 * np.max(np.abs(speed)))) if np.any(size == 0.0) else np.nan
    at_rest = f", and stands still in {100 * still:.0f} % of the time at zero" if np.isfinite(still) else ""
    name = axis.command_name
    return [
        fault(
            "sign_lost",
            name,
            f"{name} is never {'negative' if high > 0.0 else 'positive'}, but the axis goes both ways"
            f" ({100 * back:.0f} % of the travel backwards), {why}{at_rest}: its sign was not recorded",
            "record the command with its sign, or give the sign by the direction pin or the sign of the control error"
            " before the import",
            evidence={
                "forwards": static[0],
                "backwards": static[1],
                BACKWARD_TRAVEL: back,
                "explained_with_sign": explained,
                "explained": plain,
            },
            spoils=("identification",),
        )
    ]


def backward_travel(axis: Axis) -> float:
    """Share of the travel that goes the other way although the command never changes its sign.

    0 where it does, and where a load keeps it.
    """
    grid = axis.grid
    if grid is None or axis.command.size < 2:
        return 0.0
    known = axis.command[np.isfinite(axis.command)]
    low, high = float(known.min()), float(known.max())
    good = np.isfinite(grid.command) & np.isfinite(grid.speed)
    size, speed = np.abs(grid.command[good]), grid.speed[good]
    if low == high or low * high < 0.0 or speed.size < 200 or _holds_load(size, speed, grid.noise):
        return 0.0
    travel = np.array([np.sum(speed[speed > 0.0]), -np.sum(speed[speed < 0.0])])
    return float(travel.min() / travel.sum()) if travel.min() >= _BACK * travel.max() > 0.0 else 0.0


def _holds_load(size: Array, speed: Array, noise: float) -> bool:
    """Whether a command is never near zero, and has another level when the axis goes back."""
    rest = max(3.0 * noise, 0.05 * float(np.max(np.abs(speed))))
    levels = [size[rows] for rows in (speed > rest, speed < -rest)]
    if min(one.size for one in levels) < _FEWEST or np.quantile(size, 0.01) <= _LEAST * np.median(size):
        return False
    varies = float(np.sqrt(np.mean([np.var(one) for one in levels])))
    return abs(float(levels[0].mean() - levels[1].mean())) > _APART * varies


def _both_ways(size: Array, speed: Array, width: int, noise: float) -> tuple[float, float]:
    """Correlation of speed and command over windows, forwards and backwards; -1 where it is not certain."""
    count = size.size // width
    size, speed = (one[: count * width].reshape(count, width).mean(axis=1) for one in (size, speed))
    rest = max(3.0 * noise / width**0.5, 0.02 * float(np.max(np.abs(speed), initial=0.0)))
    return tuple(  # type: ignore[return-value]
        _certain(size[rows], np.abs(speed[rows])) for rows in (speed > -rest, speed < rest)
    )


def _certain(size: Array, speed: Array) -> float:
    if size.size < _FEWEST or np.std(size) == 0.0 or np.std(speed) == 0.0:
        return -1.0
    parts = min(_PARTS, size.size // 4)
    which = np.arange(size.size) * parts // size.size
    each = [float(np.corrcoef(size[which != k], speed[which != k])[0, 1]) for k in range(parts)]
    whole, error = float(np.corrcoef(size, speed)[0, 1]), float(np.sqrt((parts - 1.0) * np.var(each)))
    return whole if np.isfinite(whole) and np.isfinite(error) and whole > _ERRORS * error else -1.0


def _with_sign(axis: Axis) -> tuple[float, float]:
    """Shares of the acceleration explained by the command with the sign that fits best, and as it is; 0, 0 if unsure.

    Any signal with a free sign explains a lot. So the command must explain far more than itself shifted in time.
    """
    best = (0.0, 0.0)
    for one in responses(axis):
        target, size, others = (part[one.known] for part in (one.acceleration, np.abs(one.command), one.others))
        alone = float(np.mean(_residual(target, others) ** 2))
        if alone == 0.0:
            continue
        left = _left_with_sign(target, size, others) / alone
        shifts = [size.size * k // _SHIFTS for k in range(1, _SHIFTS)]
        shifted = min(_left_with_sign(target, np.roll(size, shift), others) for shift in shifts) / alone
        if left < _LEFT and left < _CLEARER * shifted and left < _CLEARER * (1.0 - one.share) and 1.0 - left > best[0]:
            best = (1.0 - left, one.share)
    return best


def _left_with_sign(target: Array, size: Array, others: Array) -> float:
    """Mean square of the acceleration left by the command with the sign that fits best, found by turns."""
    least = float("inf")
    # From the acceleration beside friction, the acceleration itself, and the motion: the turns stop at the nearest fit.
    for start in (_residual(target, others), target, others[:, 0]):
        force = start
        for _ in range(_TURNS):
            table = np.column_stack([np.sign(force) * size, others])
            weights = np.linalg.lstsq(table, target, rcond=None)[0]
            force = target - others @ weights[1:]
        least = min(least, float(np.mean((target - table @ weights) ** 2)))
    return least


def _residual(target: Array, table: Array) -> Array:
    return np.asarray(target - table @ np.linalg.lstsq(table, target, rcond=None)[0])
