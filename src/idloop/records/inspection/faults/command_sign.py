"""A command that lost its sign, or whose sign is turned against that of the motion."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import Response, own_share, plain_responses, regress, response, responses

# Evidence that a command may have lost its sign, or has: share of the travel that goes the other way.
BACKWARD_TRAVEL = "backward_travel"
_RELATED, _ERRORS = 0.4, 4.0  # correlation of speed and command in both directions, and its standard errors
_BACK = 0.1  # share of the travel that goes the other way
# A load: the least command in the median, and the difference of its levels in what each of them varies by.
_LEAST, _APART = 0.3, 1.0
_WINDOWS, _FEWEST, _PARTS = (3, 9, 27, 81), 12, 8
# Acceleration left by a command with a free sign: at most the first share, and the second of what the command leaves
# that is shifted in time, or that is taken as it is.
_LEFT, _CLEARER = 0.3, 0.55
_SHIFTS, _TURNS = 8, 12

# Of a turned command: standard errors of the gain below zero, and the share of the acceleration that it explains.
_TURNED, _SHARE = 6.0, 0.2
# Of a steady motion: the share of the power that the command takes, and of what the command has beside acceleration and
# position the share that runs with the speed, with its standard errors; the command at rest in that at the top speed.
_TAKEN, _RUNS, _CERTAIN, _AT_REST = 0.99, 0.3, 3.0, 0.5
_ROWS, _REST = 48, 0.02


def lost_sign(axis: Axis) -> Finding | None:
    """A command that is never negative, although it drives the axis both ways.

    A load that is larger than friction keeps the sign of the command: it has another level in each direction, and goes
    through no zero between them. Under a smaller one, or a spring, an axis goes back where the command is small. Where
    the sign was lost, it goes back the faster the larger the command is; and where the inertia counts, the force that
    the motion needs has the size of the command with either sign.
    """
    grid, back = axis.grid, backward_travel(axis)
    if grid is None or not back:
        return None
    good = np.isfinite(grid.command) & np.isfinite(grid.speed)
    size, speed = np.abs(grid.command[good]), grid.speed[good]
    static = max((_both_ways(size, speed, width, grid.noise) for width in _WINDOWS), key=min)
    explained, plain = _with_sign(axis)
    if min(static) >= _RELATED:
        why = f"the faster the larger it is (correlation {static[0]:.2f} forwards and {static[1]:.2f} backwards)"
    elif explained > 0.0:
        own = f"with a sign of its own at each instant it explains {100 * explained:.0f} % of the acceleration"
        why = f"{own}, as it is {100 * plain:.0f} %"
    else:
        return None
    if np.any(size == 0.0):
        still = float(np.mean(np.abs(speed[size == 0.0]) < 0.05 * np.max(np.abs(speed))))
        why += f", and stands still in {100 * still:.0f} % of the time at zero"
    name, never = axis.command_name, "negative" if np.nanmax(axis.command) > 0.0 else "positive"
    return fault(
        "sign_lost",
        name,
        f"{name} is never {never}, but the axis goes both ways ({100 * back:.0f} % of the travel backwards), {why}: its"
        " sign was not recorded",
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


def backward_travel(axis: Axis) -> float:
    """Share of the travel that goes the other way although the command never changes its sign.

    0 where it does, and where a load keeps it.
    """
    grid, known = axis.grid, axis.known_command
    if grid is None or axis.command.size < 2:
        return 0.0
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
    forwards, backwards = (_correlation(size[rows], np.abs(speed[rows])) for rows in (speed > -rest, speed < rest))
    return forwards, backwards


def _correlation(size: Array, speed: Array) -> float:
    """Correlation, -1 where it is less than some jackknife errors."""
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
        if left < min(_LEFT, _CLEARER * shifted, _CLEARER * (1.0 - one.share)):
            best = max(best, (1.0 - left, one.share))
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


def turned_command(axis: Axis) -> Finding | None:
    """Command and motion turned against each other: a positive command accelerates the axis backwards.

    Then it also takes power from the motion on average, which a drive never does: friction needs power. Where the
    inertia does not show, that power alone tells it, with a speed that is the larger the more is commanded: a load that
    drives the axis, such as a weight that is lowered, is braked by more.
    """
    found = response(axis, _SHARE)
    name, unit = axis.command_name, axis.unit("command")
    motion = axis.unit("position").removesuffix("/s")
    if found is not None and found.certainty <= -_TURNED and _power(axis) <= 0.0:
        what = (
            f"a positive {name} accelerates {axis.joint} backwards ({found.gain:.3g} ± {found.error:.1g} {motion}/s²"
            f" per {unit}, {100 * found.share:.0f} % of it explained): the signs of command and motion differ"
        )
        evidence = {"gain": found.gain, "error": found.error, "share": found.share}
    elif (found is None or found.certainty < _CERTAIN) and (taken := _steadily_against(axis)):
        what = (
            f"{axis.joint} moves against {name} all the time ({100 * taken:.3g} % of its power is taken from the"
            f" motion), the faster the larger it is: the signs of command and motion differ, or something else drives"
            f" {axis.joint}"
        )
        evidence = {"taken": taken}
    else:
        return None
    cure = f"set `scale: -1` for {name} in the mapping, or allow a negative gain in the model file"
    return fault("turned_command", name, what, cure, evidence=evidence, spoils=("identification",))


def is_forwards(axis: Axis) -> bool:
    """Whether a positive command accelerates an axis forwards beyond doubt, and gives power to the motion."""
    found = response(axis, _SHARE)
    return found is not None and found.certainty > _TURNED and _power(axis) > 0.0


def _power(axis: Axis) -> float:
    """Mean of command times speed."""
    return 0.0 if axis.grid is None else float(np.nanmean(axis.grid.command * axis.grid.speed))


def _steadily_against(axis: Axis) -> float:
    """Share of the power that the command takes from the motion, where it does so as a turned one; 0 elsewhere."""
    grid = axis.grid
    if grid is None:
        return 0.0
    # Without a position that of the speed: a force that depends on it, such as the weight of an arm, is no friction.
    place = grid.position if np.isfinite(grid.position).any() else np.nancumsum(grid.speed) * grid.period
    return max((_taken(one, one.functions.project(place)) for one in plain_responses(axis)), default=0.0)


def _taken(balance: Response, place: Array) -> float:
    speed = np.abs(balance.others[:, 0])
    moving = balance.known & np.isfinite(place) & (speed > _REST * np.nanmax(speed))
    if moving.sum() < _ROWS:
        return 0.0
    command, speed, place = balance.command[moving], balance.others[moving, 0], place[moving]
    power = command * speed
    taken = float(-np.sum(power[power < 0.0]) / max(np.sum(np.abs(power)), 1e-300))
    if taken < _TAKEN:
        return 0.0
    scaled = (place - np.mean(place)) / max(float(np.ptp(place)), 1e-300)
    powers = scaled[:, None] ** np.arange(4)
    table = np.column_stack([speed, powers, np.sin(place), np.cos(place), balance.acceleration[moving]])
    values, errors, left = regress(command, table)
    top = float(abs(values[0]) * np.max(np.abs(speed)))
    slope = values[0] < -_CERTAIN * errors[0] and own_share(command, table, left) > _RUNS
    return taken if slope and abs(values[1]) < _AT_REST * top else 0.0
