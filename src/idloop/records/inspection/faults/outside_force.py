"""A push from outside, and another machine from some time on: forces at one time that the command does not explain."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Integers
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import Gain, Response, plain_responses

PUSH, CHANGED = "outside_force", "changed_machine"
# Share of the acceleration that the command explains; lengths of a push that are tried [rows of a balance].
_EXPLAINED, _LENGTHS = 0.7, (1, 2, 4, 8, 16, 32)
# A push leaves so many times as much unexplained as any other time of the record so many rows away from it, and is at
# least this share of the largest command.
_LARGER, _AWAY, _SIZE = 3.5, 8, 0.15
_WIDTHS = 2  # of test functions, which show it at the same time
# Of so many other times at most this share have others nearer to them in command, its change, and speed.
_TIMES, _ODD, _NEIGHBOURS = 200, 0.95, 4
# Times of a change that are tried, as shares of the record, and the part of the larger gain by which they differ.
_CHANGES, _NEAR, _DIFFER = np.arange(2, 7) / 8.0, 0.125, 0.3
# On both sides: rows in motion, standard errors of the gain, and share of the acceleration that the command explains.
_FEWEST, _MOVING, _CERTAIN, _FOLLOWS = 60, 0.9, 8.0, 0.9
_FRICTION = 1  # column of the sign of the speed


def push(axis: Axis) -> Finding | None:
    """A push from outside: a force that the command does not explain, once.

    What the weak balance of forces lacks, such as friction, comes back whenever command and speed do.
    """
    balances = [one for one in plain_responses(axis) if one.share > _EXPLAINED]
    found = [one for balance in balances if (one := _largest(axis, balance)) is not None]
    if not found:
        return None
    ratio, force, begin, end, _ = max(found)
    # A resonance hides in balances of one width.
    if len({width for *_, start, stop, width in found if start < end and stop > begin}) < _WIDTHS:
        return None
    name, unit = axis.command_name, axis.unit("command")
    return fault(
        PUSH,
        axis.joint,
        f"from {begin:.4g} to {end:.4g} s a force like {force:.2g} {unit} of {name} acts on {axis.joint} that no"
        f" command explains, {ratio:.2g} times as much as at any other time: a push from outside, a collision, or"
        " another axis that moves it",
        "leave that time out: `--rows` of `idloop start`, `rows:` in the mapping",
        evidence={"ratio": ratio, "force": force},
        places=[(begin, end)],
    )


def _largest(axis: Axis, one: Response) -> tuple[float, float, float, float, int] | None:
    """The time that leaves most unexplained: ratio to others, force as a command, begin and end [s], width."""
    grid, rows = axis.grid, np.flatnonzero(one.known)
    if grid is None:
        return None
    table = np.column_stack([one.command, one.others])[rows]
    basis = np.linalg.qr(table)[0]
    left = one.acceleration[rows] - basis @ (basis.T @ one.acceleration[rows])
    state = np.column_stack([table[:, 0], one.functions.project(grid.command, 1)[rows], table[:, 1]])
    state /= np.maximum(state.std(axis=0), 1e-300)
    least = _SIZE * abs(one.gain) * float(np.nanmax(np.abs(axis.command)))
    best, width = None, one.functions.width
    for length in [length for length in _LENGTHS if left.size > 20 * length]:
        means = _means(left, length)
        away = length + _AWAY
        # At both ends the motion before or after is not known.
        place = away + int(np.argmax(np.abs(means[away:-away])))
        others = np.flatnonzero(np.abs(np.arange(means.size) - place) > away)
        size = abs(float(means[place]))
        ratio = size / max(float(np.max(np.abs(means[others]))), 1e-300)
        if ratio > (best[0] if best else _LARGER) and size > least and _is_usual(_means(state, length), place, away):
            step = max(width // 4, 1)
            last = min(rows[place + length - 1] * step + width, grid.time.size) - 1
            times = float(grid.time[rows[place] * step]), float(grid.time[last])
            best = (ratio, float(means[place] / one.gain), *times, width)
    return best


def _means(value: Array, length: int) -> Array:
    """Mean over so many rows from each one on."""
    return np.asarray(np.lib.stride_tricks.sliding_window_view(value, length, axis=0).mean(axis=-1))


def _is_usual(state: Array, place: int, away: int) -> bool:
    """Whether the states (n, k) at other times come as near to that at one place as they do to each other."""

    def distance(row: int) -> float:
        far = np.abs(np.arange(len(state)) - row) > away
        return float(np.mean(np.partition(np.sum((state[far] - state[row]) ** 2, axis=1), _NEIGHBOURS)[:_NEIGHBOURS]))

    every = np.unique(np.linspace(0, len(state) - 1, _TIMES).astype(np.int64))
    nearest = np.array([distance(row) for row in every if abs(row - place) > away])
    return bool(np.mean(nearest < distance(place)) < _ODD)


def changed_machine(axis: Axis) -> Finding | None:
    """Another machine, load or supply from some time on: the same command accelerates otherwise.

    The gain before and after some times is compared by a Chow test with jackknife errors, while the axis moves, beside
    friction, springs and any smooth force over the position.
    """
    grid = axis.grid
    best: tuple[float, float, float] | None = None
    for share in _CHANGES if grid is not None else ():
        parts = {one: _parts(one, share) for one in plain_responses(axis)}
        long = {one: sides for one, sides in parts.items() if min(side.size for side in sides) >= _FEWEST}
        found = {one: gains for one, sides in long.items() if _show(gains := _gains(one, sides))}
        # Noise in a loop, and what a balance lacks, change the gain at some widths of the test functions only.
        if not found or not all(before.differs(after, _DIFFER) for before, after in found.values()):
            continue
        beside = [_gains(one, parts[one], beside_position=True) for one in found]
        if not all(before.differs(after, _DIFFER) for before, after in beside):
            continue
        first, second = max(found.values(), key=lambda sides: min(abs(gain.certainty) for gain in sides))
        certain = abs(first.value - second.value) / float(np.hypot(first.error, second.error))
        if best is None or certain > best[0]:
            best = certain, float(share), second.value / first.value
    if best is None or grid is None:
        return None
    certain, share, ratio = best
    # Times between those that are tried are not told apart.
    begin, end = (float(grid.time[0] + (share + off) * np.ptp(grid.time)) for off in (-_NEAR, _NEAR))
    return fault(
        CHANGED,
        axis.joint,
        f"{axis.command_name} accelerates {axis.joint} {ratio:.3g} times as much from some time between {begin:.4g} and"
        f" {end:.4g} s on ({certain:.2g} standard errors): another machine, load, supply or unit, or two recordings in"
        " one",
        "cut the record there with `--rows` of `idloop start`, `rows:` in the mapping, and fit the parts apart",
        evidence={"ratio": ratio, "errors": certain},
        spoils=("identification",),
        places=[(begin, end)],
    )


def _parts(one: Response, share: float) -> tuple[Integers, Integers]:
    """Rows before and after a time, in motion: at rest friction takes any command, and the gain is none."""
    rows = np.flatnonzero(one.known & (np.abs(one.others[:, _FRICTION]) > _MOVING))
    cut = int(np.searchsorted(rows, share * one.known.size))
    return rows[:cut], rows[cut:]


def _gains(one: Response, parts: tuple[Integers, Integers], *, beside_position: bool = False) -> tuple[Gain, Gain]:
    before, after = (one.gain_of(part, beside_position=beside_position) for part in parts)
    return before, after


def _show(sides: tuple[Gain, Gain]) -> bool:
    """Whether the command shows on both sides of a time how it accelerates the axis."""
    return all(gain.share > _FOLLOWS and abs(gain.certainty) > _CERTAIN for gain in sides)
