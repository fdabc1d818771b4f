"""Which columns belong to one joint, and which of several joints is taken."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Sequence
from collections.abc import Mapping as Map
from dataclasses import replace
from itertools import chain, combinations
from math import pi

import numpy as np

from idloop.arrays import Array
from idloop.records.inspection.motion import white_noise
from idloop.records.recognition.column_name import parse_column_name, with_brackets
from idloop.records.recognition.driven_motion import driven_most
from idloop.records.recognition.guess import MOTION
from idloop.records.recognition.roles import RoleByName, Signal, is_called_command, is_coordinate, role_by_name
from idloop.records.recognition.signal_units import slope_of
from idloop.records.recognition.table_column import TableColumn
from idloop.records.tables.base_units import COUNTS, base_unit
from idloop.spelling import listed

_BLOCKS = 200  # means along which the slope of a motion is taken
_RUNS_WITH = 0.9  # correlation of a velocity with the slope of its position
_IN_ONE_UNIT = (0.7, 1.4)  # of a velocity to the slope of its position in the same unit, by which a filter is no other
_AT_REST = 0.05  # travel of a joint beside that of the farthest, which shows nothing of its velocity
_SAME = 0.1  # of the spread of a column, by which one that runs with it differs
_FEWEST_JOINTS, _MOST_COLUMNS = 2, 64
_OF_SEVERAL = re.compile(r"(.*)\[(\d+)\]")
_NUMBERED = re.compile(r".*\D(\d+)")
_SIDES = {"x", "y", "z", "left", "right"}  # words that tell one axis of a machine from another
_PATH_BLOCKS, _FEWEST_BLOCKS = 4000, 4  # means along which the path of a joint is measured


def slopes_and_means(values: Sequence[Array], runs: Iterable[slice]) -> tuple[Array, Array]:
    """Slopes of columns between means over blocks of rows, and the means between them, each shape (m, columns)."""
    slopes, between = [np.zeros((0, len(values)))], [np.zeros((0, len(values)))]
    for run in runs:
        table = np.column_stack([one[run] for one in values])
        length = max(1, len(table) // _BLOCKS)
        means = table[: len(table) // length * length].reshape(-1, length, len(values)).mean(axis=1)
        slopes.append((means[2:] - means[:-2]) / length)
        between.append(means[1:-1])
    return np.concatenate(slopes), np.concatenate(between)


def in_blocks(columns: dict[str, TableColumn]) -> tuple[dict[str, TableColumn], str]:
    """Name the columns of joints that lie in blocks, and say so: a velocity lies a block behind its position.

    None are named where a name says what moves.
    """
    free = [one for one in columns.values() if not one.by_name.role]
    if any(one.by_name.role in (*MOTION, "command") for one in columns.values()):
        return {}, ""
    if not 3 * _FEWEST_JOINTS <= len(free) <= _MOST_COLUMNS or len({one.value.size for one in free}) > 1:
        return {}, ""
    runs_with = _correlations(free)
    travel = np.array([float(np.ptp(one.value[np.isfinite(one.value)])) for one in free])
    found = max(_pairs(runs_with, travel), default=None)
    if found is None:
        return {}, ""
    *_, before, count = found
    first = -before
    # A set-point and what follows it are no two joints.
    if count == _FEWEST_JOINTS and run_together(free[first].value, free[first + 1].value):
        return {}, ""
    forces = _forces(free, runs_with, first, count)
    blocks: dict[Signal, int] = {"position": first, "velocity": first + count}
    blocks |= {} if forces is None else {"command": forces}
    named = {
        one.name: replace(
            one,
            parsed=replace(one.parsed, index=str(joint + 1)),
            by_name=RoleByName(role, 1.0, f"the {role} of joint {joint + 1} in blocks of {count} columns"),
        )
        for role, begin in blocks.items()
        for joint, one in enumerate(free[begin : begin + count])
    }
    said = ", ".join(f"{role} {free[k].name!r} to {free[k + count - 1].name!r}" for role, k in blocks.items())
    return named, f"no name says what the columns are: they are taken as those of {count} joints, {said}"


def _correlations(free: list[TableColumn]) -> Array:
    """Correlation of the slope of each column (rows) with each column, 0 where one stands still.

    A velocity passes through zero where its position turns back. A force that changes its sign with the velocity, but
    lies on top of a constant, does not: the smaller of the correlations with and without the means counts.
    """
    slopes, means = slopes_and_means([one.value for one in free], free[0].runs)
    good = np.isfinite(slopes).all(axis=1) & np.isfinite(means).all(axis=1)
    pairs = [(one - one.mean(axis=0) if good.any() else one, one) for one in (slopes[good], means[good])]
    centred, whole = (_cosines(slope, mean) for slope, mean in zip(*pairs, strict=True))
    return np.minimum(centred, whole)


def _cosines(slopes: Array, means: Array) -> Array:
    sizes = np.outer(np.sqrt((slopes**2).sum(axis=0)), np.sqrt((means**2).sum(axis=0)))
    return np.asarray(np.divide(slopes.T @ means, sizes, out=np.zeros_like(sizes), where=sizes > 0.0))


def _pairs(runs_with: Array, travel: Array) -> Iterable[tuple[int, bool, int, int]]:
    """Yield how many joints show, whether whole blocks lie before them, where they begin, negative, and how many are.

    Accelerations are the slopes of velocities as well, and forces may seem to be: the first pair of blocks counts.
    """
    for count in range(_FEWEST_JOINTS, len(travel) // 2 + 1):
        for first in range(len(travel) - 2 * count + 1):
            place = np.arange(first, first + count)
            shows = runs_with[place, place + count] > _RUNS_WITH
            rests = travel[place] < _AT_REST * travel[place].max(initial=0.0)
            # One joint alone, as in a test of each of an arm, shows blocks where they fill the table.
            filled = first % count == 0 and len(travel) % count == 0
            if shows.sum() >= (1 if filled else _FEWEST_JOINTS) and (shows | rests).all():
                yield int(shows.sum()), first % count == 0, -first, count


def _forces(free: list[TableColumn], runs_with: Array, first: int, count: int) -> int | None:
    """Return where the block begins that is neither set-points nor accelerations; those behind the motions first."""
    behind = range(first + 2 * count, len(free) - count + 1, count)
    for begin in chain(behind, range(first - count, -1, -count)):
        shown = [k for k in range(count) if runs_with[first + k, first + count + k] > _RUNS_WITH]
        moves = [k for k in shown if free[begin + k].moves]
        # An acceleration is the slope of a velocity, a set-point runs with the position: so it is in all joints.
        slopes = [runs_with[first + count + k, begin + k] > _RUNS_WITH for k in moves]
        copies = [run_together(free[first + k].value, free[begin + k].value) for k in moves]
        if moves and not all(slopes) and not all(copies):
            return begin
    return None


def run_together(one: Array, other: Array) -> bool:
    """Whether two columns have nearly the same values."""
    if one.size != other.size:
        return False
    known = np.isfinite(one) & np.isfinite(other)
    return bool(known.any()) and float(np.std((one - other)[known])) < _SAME * float(np.std(one[known]))


def rates_among_states(columns: Map[str, TableColumn], seconds: Array) -> dict[str, TableColumn]:
    """Return the columns that are velocities where the numbers of a letter are those of states: q1, q2, q3 and q4.

    A state is the velocity of one before it where it is its slope, in radians and seconds or in metres and seconds.
    None are where another column is called a velocity.
    """
    if any(one.by_name.role == "velocity" for one in columns.values()):
        return {}
    states = [one for one in columns.values() if one.by_name.role == "position" and is_coordinate(one.parsed)]
    states = [one for one in states if one.moves and one.value.size == seconds.size]
    rates: dict[str, TableColumn] = {}
    for place, rate in combinations(states, 2):
        if place.parsed.words != rate.parsed.words or {place.name, rate.name} & rates.keys():
            continue
        slope = slope_of(seconds, place.value, rate.value, place.runs)
        if slope is not None and slope.correlation > _RUNS_WITH and _IN_ONE_UNIT[0] < slope.value < _IN_ONE_UNIT[1]:
            role = RoleByName("velocity", rate.by_name.rank, f"it is the slope of {place.name!r}")
            rates[rate.name] = replace(rate, by_name=role, parsed=replace(rate.parsed, index=place.parsed.index))
    return rates


def joints_by_name(names: Iterable[str]) -> dict[str, str] | None:
    """Return the joint of each column where several have columns of the same names, as ``X.u``, ``Y.u``, or None."""
    groups: dict[str, set[str]] = {}
    paths = {name: with_brackets(name).replace("/", ".").rpartition(".") for name in names}
    for joint, _, own in paths.values():
        groups.setdefault(joint, set()).add(own)
    alike = [
        joint
        for joint, own in groups.items()
        if joint and len(own) > 1 and sum(own == other for other in groups.values()) > 1
    ]
    if not alike:
        return None
    joints = {name: joint for name, (joint, _, _) in paths.items() if joint in alike}
    # What was measured of a joint and what was asked of it may stand apart: motor_state[1].q and motor_cmd[1].tau.
    places = [_OF_SEVERAL.fullmatch(joint) for joint in alike]
    if all(places) and len({one[1] for one in places if one}) > 1:
        return {name: joint[joint.rindex("[") + 1 : -1] for name, joint in joints.items()}
    # An array of commands has one for each joint: that of joint1 is commands[1].
    numbers = {match[1]: joint for joint in alike if (match := _NUMBERED.fullmatch(joint))}
    elements = {name: _OF_SEVERAL.fullmatch(path) for name, (_, _, path) in paths.items() if name not in joints}
    of_arrays = {name: numbers[one[2]] for name, one in elements.items() if one and one[2] in numbers}
    return joints | (of_arrays if len(numbers) == len(alike) else {})


def joints_by_side(names: Iterable[str]) -> dict[str, str] | None:
    """Return the axis of each column where a word says it, and each has its command: ``pwm left``, or None."""
    axes: dict[str, dict[tuple[str, ...], str]] = {}
    for name in names:
        words = parse_column_name(name).words
        for side in set(words) & _SIDES:
            axes.setdefault(side, {})[tuple(word for word in words if word != side)] = name
    roles = [{role_by_name(parse_column_name(name)).role for name in own.values()} for own in axes.values()]
    driven = all(some & {"command", "effort"} and some & set(MOTION) for some in roles)
    if len(axes) < 2 or not driven or len({frozenset(own) for own in axes.values()}) > 1:
        return None
    return {name: side for side, own in axes.items() for name in own.values()}


def one_joint(
    columns: dict[str, TableColumn],
    named: set[str],
    doubts: list[str],
    *,
    command: str = "",
    by_path: bool = False,
) -> dict[str, TableColumn]:
    """Return the columns of one joint, where a log has several: that which the user names, or that which moves most.

    Where names say of some joints only that they were commanded, it is one of these: another was driven by them. So it
    is where only some of them have a force that was not the same throughout. Of joints beside one command it is the one
    that this drives, as an arm and not the pendulum on it.

    `command`: the column that the user names as the command, if any.
    """
    by_joint = _motions(columns)
    # Names of their own, which differ from joint to joint, say what is measured and not of which joint.
    own = {
        one.name: one.name.replace("/", ".").rpartition(".")[2]
        if by_path
        else tuple(word for word in one.parsed.words if word != one.parsed.index)
        for one in columns.values()
    }
    roles = [(one.by_name.role, own[one.name]) for some in by_joint.values() for one in some]
    if len(by_joint) < 2 or len(set(roles)) == len(roles):
        return columns
    # Beside a position without a number, numbers of what stands alone are those of states: x1, x2 and x3.
    whole = {one.by_name.role for one in columns.values() if not one.parsed.index and one.moves}
    if all(len(some) == 1 for some in by_joint.values()) and whole & {role for role, _ in roles}:
        return columns
    # A motion that is named says more than the command that is named beside it.
    said = [one.parsed.index for some in by_joint.values() for one in some if one.name in named]
    said += [one.parsed.index for one in columns.values() if one.name in named and one.parsed.index in by_joint]
    chosen = said[0] if said else ""
    if not chosen:
        driven = [one for one in columns.values() if one.moves and one.by_name.role in ("command", "effort")]
        commanded = {one.parsed.index for one in driven if is_called_command(one.parsed)}
        commanded = commanded or {one.parsed.index for one in driven}
        among = {index: some for index, some in by_joint.items() if index in commanded} or by_joint
        common = [columns[command]] if command in columns else driven
        by_command = _driven(among, common[0]) if len(common) == 1 and not common[0].parsed.index else ""
        chosen = by_command or _moving_most(among)
        why = "which moves most" if len(among) == len(by_joint) else "the one with a command"
        if 1 < len(among) < len(by_joint):
            why = "which moves most of those with a command"
        if by_command:
            why = f"whose motion explains {common[0].name!r}"
        others = (one for index, some in by_joint.items() if index != chosen for one in some)
        other = next((one for one in others if one.by_name.role == "position"), None)
        example = f", as in --position {shlex.quote(other.name)}" if other is not None else ""
        shown = _last_parts(by_joint)
        doubts.append(
            f"the log has {len(by_joint)} joints ({listed(shown.values())}); joint {shown[chosen]}, {why}, is taken:"
            f" for another, name its columns{example}"
        )
    return {name: one for name, one in columns.items() if name in named or one.parsed.index in ("", chosen)}


def _last_parts(joints: Iterable[str]) -> dict[str, str]:
    """Last part of the path of each joint, where these tell them apart."""
    last = {joint: joint.rpartition(".")[2] for joint in joints}
    return last if len(set(last.values())) == len(last) else {joint: joint for joint in last}


def joints_with_command(columns: Map[str, TableColumn]) -> tuple[str, ...]:
    """Return the joints of which a log has a motion and a command or effort each; none where it has only one."""
    driven = {one.parsed.index for one in columns.values() if one.by_name.role in ("command", "effort")}
    found = tuple(joint for joint in _motions(columns) if joint in driven)
    return found if len(found) > 1 else ()


def _motions(columns: Map[str, TableColumn]) -> dict[str, list[TableColumn]]:
    """Return the motions of each joint that has an index."""
    by_joint: dict[str, list[TableColumn]] = {}
    for one in columns.values():
        if one.by_name.role in MOTION and one.parsed.index:
            by_joint.setdefault(one.parsed.index, []).append(one)
    return by_joint


def _driven(by_joint: Map[str, list[TableColumn]], command: TableColumn) -> str:
    """Return the joint that one command drives; empty where the motions do not tell."""
    positions = {index: one.value for index, some in by_joint.items() for one in some if one.by_name.role == "position"}
    return driven_most(positions, command.value, command.runs)


def _moving_most(by_joint: Map[str, list[TableColumn]]) -> str:
    """Return the joint with the longest path: of its position, of its velocity where there is no position."""
    every = [one for some in by_joint.values() for one in some]
    role = "position" if any(one.by_name.role == "position" for one in every) else "velocity"
    travel: dict[str, dict[str, float]] = {}  # by quantity, then by joint
    for index, some in by_joint.items():
        for one in some:
            unit, factor = ("", 1.0)
            if one.by_name.role != role:
                continue
            if one.parsed.unit and one.parsed.unit not in COUNTS:
                unit, factor = base_unit(one.parsed.unit, role, one.name)
            own = travel.setdefault(unit, {})
            own[index] = max(own.get(index, 0.0), factor * _travel(one.value))
    # Metres and radians compare as shares of the longest path in each.
    shares: dict[str, float] = {}
    for own in travel.values():
        largest = max(own.values()) or 1.0
        for index, one_travel in own.items():
            shares[index] = max(shares.get(index, 0.0), one_travel / largest)
    return max(shares, key=lambda index: shares[index])


def _travel(value: Array) -> float:
    """Path of a signal beyond that of its noise: a joint at rest has none, however noisy its sensor."""
    known = value[np.isfinite(value)]
    length = 1 + known.size // _PATH_BLOCKS
    blocks = known[: known.size // length * length].reshape(-1, length).mean(axis=1)
    if blocks.size < _FEWEST_BLOCKS:
        return 0.0
    # Differences of noise are 2/√π of its standard deviation on average, and their sum varies by less than its √n-fold.
    noise = white_noise(known) / length**0.5
    steps = blocks.size - 1
    path = float(np.abs(np.diff(blocks)).sum()) - 2.0 / pi**0.5 * noise * steps
    return path if path > 4.0 * noise * steps**0.5 else 0.0
