"""Limits of the drive: a force, a rate and a speed that it does not exceed, however large the command."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis, Grid
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import (
    Response,
    beyond,
    curved_friction,
    own_share,
    plain_responses,
    position_forces,
    regress,
    responses,
)

KIND = "not_followed"

# Of a force: command levels tried, as shares of the largest; the gain beyond them is below this share of the gain up to
# there.
_LEVELS, _GAIN = (0.35, 0.5, 0.65, 0.8), 0.35
_ERRORS = 6.0  # standard errors of the change of the gain, and of the gain itself
# Share of the time beyond the level, and of the acceleration left by one gain that the change explains.
_BEYOND, _EXPLAINS = 0.05, 0.3
_FEWEST = 48
_ENOUGH = 0.99  # share of the acceleration above which the command as it is explains enough
# Share of the part beyond a level that must not follow from the command and a constant: of two levels all does.
_BENDS = 0.02

# Of a rate: time in which the drive passes the range of the command, and time constants of lags [samples]; the best is
# refined.
_PASSES, _LAGS, _NEAR = 2.0 ** np.arange(2, 10), 2.0 ** np.arange(-1, 8), 2.0 ** np.arange(-0.75, 1.0, 0.25)
_WIDEST = 129  # of the test functions [samples]
# Delays [samples] of the limited command and of its rivals.
_DELAYS = np.concatenate([np.arange(0.0, 2.0, 0.25), 2.0 ** np.arange(1.0, 6.0, 0.25)])
# Share of the acceleration that the limited command explains, and of what its best rival leaves that it leaves; the
# share that the command as it is must not explain.
_EXPLAINED, _LEFT, _PLAIN = 0.94, 0.7, 0.98

# Of a speed: band below the largest speed, which lies above the limit by the noise itself: at least this share of it
# and so many times the noise, at most the second share.
_BAND, _NOISE, _WIDE = 0.01, 4.0, 0.06
# Share of the time in the band, visits to it from below the two bands under it, and how much fuller it is than these.
_SHARE, _VISITS, _FULLER = 0.03, 2, 3.0
_SPREAD, _PUSHES = 0.12, 0.4  # spread of the commands there, and the smallest usual one, as shares of the largest
_ODD, _BLOCKS = 0.005, 200  # largest speeds left out, and blocks that a record is averaged to at least


def limited_force(axis: Axis, slower: float = np.inf) -> Finding | None:
    """A command beyond what the drive applies: the acceleration stops growing with it.

    The part of the command beyond a level is added to the balance; its gain takes back that of the whole command. Only
    motion that is slower than a speed counts.
    """
    grid = axis.grid
    if grid is None or not np.isfinite(grid.command).any():
        return None
    largest = float(np.nanmax(np.abs(grid.command)))
    # A test function with a sample that is too fast counts as unknown.
    fast = np.where(np.abs(grid.speed) > slower, np.nan, 0.0)
    parts = {}
    for level in (share * largest for share in _LEVELS):
        part = beyond(grid.command, level)
        if _shows_bend(axis.known_command, level) and _BEYOND < np.mean(part != 0.0) < 1.0 - _BEYOND:
            parts[level] = part + fast
    found = []
    for one in responses(axis):
        for level, part in parts.items() if one.share < _ENOUGH else ():
            target, table = one.with_terms(part, curved_friction(grid))
            if target.size < _FEWEST:
                continue
            values, errors, left = regress(target, table)
            if _bends(values, errors) and _bends_beside_position(one, part, grid):
                found.append((own_share(target, table, left), level, float(1.0 + values[0] / values[1])))
    explains, level, kept = max(found, default=(0.0, 0.0, 0.0))
    if not explains > _EXPLAINS:
        return None
    name, unit = axis.command_name, axis.unit("command")
    return fault(
        KIND,
        name,
        f"beyond {level:.3g} {unit} the acceleration grows with {name} only {100 * max(kept, 0.0):.0f} % as much as"
        f" below (command up to {largest:.3g} {unit}): the drive limits it",
        "keep the command below the limit, or add `saturation@input` to the effects of the model file",
        evidence={"level": level, "gain_beyond": kept, "largest": largest},
    )


def _bends(values: Array, errors: Array) -> bool:
    """Whether the gain of the command falls beyond the level, by the coefficients of that part and of the command."""
    certain = values[0] < -_ERRORS * errors[0] and values[1] > _ERRORS * errors[1]
    return bool(certain and values[1] + values[0] < _GAIN * values[1])


def _bends_beside_position(one: Response, part: Array, grid: Grid) -> bool:
    """Whether the gain falls beside the weight of an arm as well, which a large command may hold in a loop."""
    forces = position_forces(grid)
    target, table = one.with_terms(part, [*curved_friction(grid), *forces])
    return not forces or _bends(*regress(target, table)[:2])


def _shows_bend(command: Array, level: float) -> bool:
    """Whether a command (n,) as it was sent has values from which a bend at a level shows, beside a gain and an offset.

    Means of it over a sample have values between any two levels, which the drive never got.
    """
    part = beyond(command, level)
    size = float(np.std(command) * np.std(part))
    shared = float(np.mean((command - command.mean()) * (part - part.mean()))) / size if size > 0.0 else 1.0
    return 1.0 - shared**2 > _BENDS


def limited_rate(axis: Axis) -> Finding | None:
    """A command that changes faster than the drive follows: its ramp, jerk or slew-rate limit.

    The balance of forces is taken with the command as a drive of a limited rate would apply it. A lag of the drive
    makes a jump a gradual change as well, and a delay of part of a sample does between samples; so the limit must
    explain far more than any lag, and with a delay far more than any lag with a delay.
    """
    grid = axis.grid
    if grid is None or not np.isfinite(grid.command).any():
        return None
    # Missing values hold the last known one; before it, the first.
    known = np.flatnonzero(np.isfinite(grid.command))
    last = np.searchsorted(known, np.arange(grid.command.size), side="right") - 1
    command = grid.command[known[np.maximum(last, 0)]]
    span = float(np.ptp(command))
    steepest = float(np.max(np.abs(np.diff(command))))
    passes = _PASSES[steepest > span / _PASSES]
    plain = [one for one in plain_responses(axis) if one.functions.width <= _WIDEST and one.share < _PLAIN]
    if not passes.size or not plain:
        return None
    limited = [(float(one), _limited(command, span / one)) for one in passes]
    others = [command, *(_lagged(command, one) for one in _LAGS)]
    best, where = min(((_compare(one, limited, others), one) for one in plain), key=lambda found: found[0][0])
    if not _is_clear(best):
        return None
    times = [float(best[2] * one) for one in _NEAR]
    near = [(time, late) for time in times for late in _delayed(_limited(command, span / time))]
    best = _compare(where, near, [late for one in others for late in _delayed(one)])
    if not _is_clear(best):
        return None
    ratio, explained, time = best
    rate, steepest = span / (time * grid.period), steepest / grid.period
    name, unit = axis.command_name, axis.unit("command")
    return fault(
        KIND,
        name,
        f"{name} changes by up to {steepest:.3g} {unit}/s, but the axis accelerates as if by {rate:.2g} {unit}/s at"
        f" most ({100 * explained:.1f} % of the acceleration explained): the drive limits its rate",
        "raise the ramp or slew-rate limit of the drive, or change the command more slowly",
        evidence={"rate": rate, "steepest": steepest, "explained": explained, "left": ratio},
        spoils=("delays",),
    )


def _compare(one: Response, limited: list[tuple[float, Array]], others: list[Array]) -> tuple[float, float, float]:
    """Return what the best limit leaves over what the best other leaves, its share explained, and its time."""
    basis = np.linalg.qr(one.others[one.known])[0]
    target = one.acceleration[one.known]
    target = target - basis @ (basis.T @ target)
    power = float(target @ target)

    def left(command: Array) -> float:
        column = one.functions.project(command)[one.known]
        column = column - basis @ (basis.T @ column)
        size = float(column @ column)
        return power - float(column @ target) ** 2 / size if size > 0.0 else power

    least, time = min((left(command), time) for time, command in limited)
    without = min(left(command) for command in others)
    return (least / without, 1.0 - least / power, time) if without > 0.0 else (1.0, 0.0, time)


def _is_clear(found: tuple[float, float, float]) -> bool:
    return found[0] <= _LEFT and found[1] >= _EXPLAINED


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


def limited_speed(axis: Axis) -> Finding | None:
    """A speed that the drive does not exceed: the axis stays at it under commands of many sizes.

    Elsewhere the steady speed of an axis grows with its command, whatever its friction.
    """
    grid = axis.grid
    if grid is None:
        return None
    known = np.isfinite(grid.speed) & np.isfinite(grid.command)
    speed, command, time = grid.speed[known], grid.command[known], grid.time[known]
    if speed.size < 2 * _BLOCKS or not np.any(command):
        return None
    top = float(np.quantile(np.abs(speed), 1.0 - _ODD))
    block = int(np.clip((2.0 * grid.noise / max(_BAND * top, 1e-300)) ** 2, 1, speed.size // _BLOCKS))
    count = speed.size // block
    speed, command, time = (one[: count * block].reshape(count, block).mean(axis=1) for one in (speed, command, time))
    largest = float(np.max(np.abs(command)))
    for sign in (1.0, -1.0):
        forward, pushes = sign * speed, sign * command
        top = float(np.quantile(forward, 1.0 - _ODD))
        band = max(_NOISE * grid.noise / block**0.5, _BAND * top)
        if top <= 0.0 or band > _WIDE * top:
            continue
        at, left = forward > top - band, forward <= top - 3.0 * band
        below = np.count_nonzero(~left & ~at)
        # Noise takes a speed out of the band and back within one stay.
        certain = np.flatnonzero(at | left)
        visits = certain[np.diff(at[certain].astype(np.int8), prepend=0) > 0]
        if at.mean() < _SHARE or visits.size < _VISITS or np.count_nonzero(at) < _FULLER * below:
            continue
        low, high = np.quantile(pushes[at], [0.1, 0.9])
        if high - low < _SPREAD * largest or low < _PUSHES * largest:
            continue
        name, unit = axis.command_name, axis.unit("command")
        return fault(
            KIND,
            name,
            f"{axis.joint} does not exceed {sign * top:.4g} {axis.unit('velocity')}, under {name} from"
            f" {sign * low:.3g} to {sign * high:.3g} {unit} ({100 * at.mean():.2g} % of the time): the drive limits its"
            " speed",
            "raise the speed limit of the drive, or command less",
            evidence={"speed": sign * top, "share": at.mean(), "low": low, "high": high},
            spoils=("viscous friction",),
            places=[(float(time[k]), float(time[min(k + 1, time.size - 1)])) for k in visits],
        )
    return None
