"""A command that changes faster than the drive follows: its ramp, jerk or slew-rate limit.

The balance of forces is taken with the command as a drive of a limited rate would apply it. A lag of the drive makes a
jump a gradual change as well, and a delay of part of a sample does between samples; so the limit must explain far more
than any lag, and with a delay far more than any lag with a delay.
"""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import PLAIN, Response, responses

# Time in which the drive passes the range of the command, and time constants of lags [samples]; the best is refined.
_PASSES, _LAGS, _NEAR = 2.0 ** np.arange(2, 10), 2.0 ** np.arange(-1, 8), 2.0 ** np.arange(-0.75, 1.0, 0.25)
_WIDEST = 129
# Delays [samples] of the limited command and of its rivals.
_DELAYS = np.concatenate([np.arange(0.0, 2.0, 0.25), 2.0 ** np.arange(1.0, 6.0, 0.25)])
# Share of the acceleration that the limited command explains, and of what its best rival leaves that it leaves.
_EXPLAINED, _LEFT = 0.94, 0.7
# Share of the acceleration above which the command as it is explains enough.
_ENOUGH = 0.98


def check(axis: Axis) -> list[Finding]:
    """Compare a limited rate with a lag and with the command as it is."""
    grid = axis.grid
    if grid is None or not np.isfinite(grid.command).any():
        return []
    command = _filled(grid.command)
    span = float(np.ptp(command))
    steepest = float(np.max(np.abs(np.diff(command))))
    passes = _PASSES[steepest > span / _PASSES]
    plain = [
        one
        for one in responses(axis)
        if one.functions.power == PLAIN and one.functions.width <= _WIDEST and one.share < _ENOUGH
    ]
    if not passes.size or not plain:
        return []
    limited = [(float(one), _limited(command, span / one)) for one in passes]
    others = [command, *(_lagged(command, one) for one in _LAGS)]
    best = min((_compare(one, limited, others) for one in plain), key=lambda found: found[0])
    if not _is_clear(*best[:2]):
        return []
    _, _, time, where = best
    near = [(float(time * one), late) for one in _NEAR for late in _delayed(_limited(command, span / (time * one)))]
    ratio, explained, time, _ = _compare(where, near, [late for one in others for late in _delayed(one)])
    if not _is_clear(ratio, explained):
        return []
    rate = span / (time * grid.period)
    name, unit = axis.command_name, axis.unit("command")
    return [
        fault(
            "not_followed",
            name,
            f"{name} changes by up to {steepest / grid.period:.3g} {unit}/s, but the axis accelerates as if by"
            f" {rate:.2g} {unit}/s at most ({100 * explained:.1f} % of the acceleration explained): the drive limits"
            " its rate",
            "raise the ramp or slew-rate limit of the drive, or change the command more slowly",
            evidence={"rate": rate, "steepest": steepest / grid.period, "explained": explained, "left": ratio},
            spoils=("delays",),
        )
    ]


def _compare(
    found: Response, limited: list[tuple[float, Array]], others: list[Array]
) -> tuple[float, float, float, Response]:
    """Return what the best limit leaves over what the best other leaves, its share explained, its time, and where."""
    known = found.known
    basis = np.linalg.qr(found.others[known])[0]
    target = found.acceleration[known]
    target = target - basis @ (basis.T @ target)
    power = float(target @ target)

    def left(command: Array) -> float:
        column = found.functions.project(command)[known]
        column = column - basis @ (basis.T @ column)
        size = float(column @ column)
        return power - float(column @ target) ** 2 / size if size > 0.0 else power

    least, time = min((left(command), time) for time, command in limited)
    without = min(left(command) for command in others)
    if not without > 0.0:
        return 1.0, 0.0, time, found
    return least / without, 1.0 - least / power, time, found


def _is_clear(ratio: float, explained: float) -> bool:
    return ratio <= _LEFT and explained >= _EXPLAINED


def _limited(command: Array, step: float) -> Array:
    """Follow a command (n,) by at most `step` in a sample."""
    applied, found = float(command[0]), []
    for value in command.tolist():
        applied = min(max(value, applied - step), applied + step)
        found.append(applied)
    return np.array(found)


def _lagged(command: Array, time: float) -> Array:
    from scipy.signal import lfilter

    decay = float(np.exp(-1.0 / time))
    return np.asarray(lfilter([1.0 - decay], [1.0, -decay], command - command[0]) + command[0])


def _delayed(command: Array) -> list[Array]:
    """Delay a command (n,), as it was held from sample to sample, by each of the delays."""
    rows = np.arange(command.size)
    return [np.interp(rows - one, rows, command) for one in _DELAYS]


def _filled(command: Array) -> Array:
    """Hold the last known value, and the first before it."""
    known = np.flatnonzero(np.isfinite(command))
    return np.asarray(command[known[np.maximum(np.searchsorted(known, np.arange(command.size), side="right") - 1, 0)]])
