"""Roles of columns whose names say nothing, by what their values have to do with each other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from idloop.arrays import Array
from idloop.records.inspection.motion import white_noise
from idloop.records.recognition.column_name import FLAGS
from idloop.records.recognition.guess import MOTION, Given, Guess, with_unit
from idloop.records.recognition.joints import run_together, slopes_and_means
from idloop.records.recognition.signal_units import motion_units
from idloop.records.recognition.table_column import Choice, TableColumn
from idloop.records.recognition.time_base import TimeBase
from idloop.records.tables.expression import Expression

_FEWEST_ROWS = 10  # that show noise
_TINY = 1e-9  # share of the variance that is no change
_COARSE = 0.3  # of the range, for the steps of a sensor
_MOST_BY_LOOKS = 3  # columns without a name that are recognised by their values alone
_MOST_PAIRED = 6  # ... of which two are a position and its slope
_MOST_COMPARED = 20  # columns without a name that are held against the slope of the position
_FOLLOWS = 0.6  # correlation of a velocity with the command
# Of a command in steps: levels at least, and share of the rows in which it changes at most.
_FEWEST_LEVELS, _MOST_CHANGES = 3, 0.02


def smoothest_first(signals: Sequence[tuple[Array, Sequence[slice]]]) -> list[int]:
    """Order signals, which are not constant, by how soon they change; places in the sequence, the smoothest first.

    Changes are compared at lags from one row to a sixteenth of the record, each as a share of the spread and above what
    noise and quantisation may do to any of the signals.

    `signals`: values, shape (n,), and the rows of each run.
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
    """Mean square change by noise or quantisation at most, and by flicker, as shares of the variance."""
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


def fill_by_values(log: Choice) -> None:
    """Fill roles whose columns have names that say nothing: a command jumps, a motion is smooth."""
    chosen = log.chosen
    lacks_command = "command" not in chosen and not log.left_out("command")
    held = [one for one in log.nameless() if one.is_held]
    if lacks_command and len(held) == 1:
        chosen["command"] = _by_values("command", held[0], "it is constant in each run")
        lacks_command = False
    _velocity_by_slope(log)
    _position_by_slope(log)
    free = log.nameless()
    # Only a few columns can be told apart by their looks, and one in steps from all that follow it.
    if not free or len(free) > _MOST_BY_LOOKS:
        if not any(role in chosen or log.left_out(role) for role in MOTION):
            _by_steps(log, free, lacks_command=lacks_command)
        return
    free = [free[k] for k in smoothest_first([(one.value, one.runs) for one in free])]
    # What has a unit that no motion has is none.
    may_move = [one for one in free if not one.parsed.written and not _is_flag(one)]
    if not any(role in chosen for role in MOTION) and not log.left_out("position") and may_move:
        smoothest = may_move[0]
        free = [one for one in free if one is not smoothest]
        if free and run_together(smoothest.value, free[0].value):
            # Of two that run together the one with less noise is the set-point, which is found below.
            smoothest = max(smoothest, free.pop(0), key=lambda one: change_by_noise(one.value)[0])
        taken = {one.column for one in chosen.values()}
        # A position and a velocity are both larger in the runs in which a held command is.
        driven = [one.value for one in log.columns.values() if (one in free or one.name in taken) and not one.is_held]
        may_be = not log.left_out("velocity") and not smoothest.is_angle
        role = "velocity" if may_be and any(follows(smoothest.value, one) for one in driven) else "position"
        chosen[role] = _by_values(role, smoothest, "it is the smoothest of the columns that are left")
    # What was measured acts as the input, and its name says so.
    if lacks_command and free and "effort" not in chosen:
        chosen["command"] = _by_values("command", free[-1], "it jumps most of the columns that are left")


def _by_steps(log: Choice, free: Sequence[TableColumn], *, lacks_command: bool) -> None:
    """Take the one column that is held in steps for the command, and what follows it most closely for the motion."""
    known = log.column("command")
    in_steps = [one for one in (free if known is None else [known]) if _is_in_steps(one)]
    if len(in_steps) != 1 or (known is None and not lacks_command):
        return
    command = in_steps[0]
    others = [one for one in free if one is not command and not one.parsed.written and not _is_flag(one)]
    together = {one.name: _together(one.value, command.value) for one in others if one.value.size == command.value.size}
    motion = max((one for one in others if one.name in together), key=lambda one: together[one.name], default=None)
    if motion is None or together[motion.name] <= _FOLLOWS:
        return
    role = "velocity" if follows(motion.value, command.value, motion.runs) and not motion.is_angle else "position"
    if known is None:
        log.chosen["command"] = _by_values("command", command, "it is held in steps, and others follow it")
    log.chosen[role] = _by_values(role, motion, f"it follows {command.name!r} most closely")


def _is_in_steps(one: TableColumn) -> bool:
    """Whether a column changes in a few of its rows, between several levels."""
    known = one.value[np.isfinite(one.value)]
    changes = float(np.mean(np.diff(known) != 0.0)) if known.size > _FEWEST_ROWS else 1.0
    return changes < _MOST_CHANGES and np.unique(known).size >= _FEWEST_LEVELS


def _is_flag(one: TableColumn) -> bool:
    """Whether a column has two values, or a name such as ``pin state``."""
    words = set(one.parsed.words)
    return np.unique(one.value[np.isfinite(one.value)]).size < 3 or bool(words & FLAGS and len(words) > 1)


def find_set_point(log: Choice) -> None:
    """Find the set-point of the position among the columns whose names say nothing: it runs with it."""
    place = log.column("position")
    if place is None or "reference" in log.chosen or log.left_out("reference"):
        return
    for one in log.nameless():
        # A copy of the position, such as its distance from its mean, is none.
        if run_together(place.value, one.value) and not one.times(place):
            log.chosen["reference"] = one.as_guess("reference", f"it runs with {place.name!r}").with_doubt(
                f"{one.name!r} is taken as the set-point of {place.name!r}: --reference COLUMN"
            )
            return


def _by_values(role: str, one: TableColumn, reason: str) -> Guess:
    options = "--position or --velocity" if role in MOTION else f"--{role}"
    return one.as_guess(role, reason).with_doubt(
        f"no name says what {one.name!r} is, it is taken as the {role}: {options} COLUMN"
    )


def _velocity_by_slope(log: Choice) -> None:
    """Find the velocity among the columns whose names say nothing, and the position where no name says one."""
    chosen = log.chosen
    if "velocity" in chosen or log.left_out("velocity"):
        return
    given = {one.column for one in log.given.values()}
    free = [one for one in log.nameless() if one.name not in given]
    place = log.column("position")
    if place is None and (len(free) > _MOST_PAIRED or log.left_out("position")):
        return
    spare = "command" in chosen or "effort" in chosen or log.left_out("command")
    spare = spare or any(not one.moves and not one.by_name.role for one in log.columns.values())
    found = []
    for position in free if place is None else [place]:
        # Beside a motion and its set-point one more column is the command.
        left = [one for one in free if one is position or not run_together(position.value, one.value)]
        last = len(left) - (place is None) < 2 - spare
        unit = "counts" if "scale" in position.options else position.parsed.unit
        for one in free[:_MOST_COMPARED]:
            slope = log.slope(position, one, unit) if one is not position else None
            # The last column may be a force as well, which runs with the slope by chance in no unit of a velocity.
            if slope is not None and not (last and not _in_units(log.base, position, position.unwrapped(unit), one)):
                found.append((slope.correlation, position, one))
    if not found:
        return
    _, position, best = max(found, key=lambda one: one[0])
    if place is None:
        chosen["position"] = _by_values("position", position, f"{best.name!r} runs with its slope")
    guess = best.as_guess("velocity", "it runs with the slope of the position")
    chosen["velocity"] = with_unit(guess, log.given.get("velocity", Given()).unit).with_doubt(
        f"no name says what {best.name!r} is, by the slope of the position it is taken as the velocity:"
        " --velocity COLUMN or none"
    )


def _position_by_slope(log: Choice) -> None:
    """Find the position among the columns whose names say nothing: a velocity that is known runs with its slope."""
    speed, rate = log.chosen.get("velocity"), log.column("velocity")
    if speed is None or rate is None or "position" in log.chosen or log.left_out("position"):
        return
    parts = Expression(speed.column).columns if "compute" in speed.options else ()
    free = [one for one in log.nameless()[:_MOST_COMPARED] if one.name not in parts]
    found = [(slope.correlation, one) for one in free if (slope := log.slope(one, rate)) is not None]
    if found:
        _, best = max(found, key=lambda one: one[0])
        log.chosen["position"] = _by_values("position", best, f"{speed.column!r} runs with its slope")


def _in_units(base: TimeBase, place: TableColumn, position: Array, rate: TableColumn) -> bool:
    """Whether a column is the slope of a position in some unit of a velocity."""
    run = longest_way(position, rate.runs)
    series = (base.seconds[run], position[run], rate.value[run])
    return motion_units(*series, (place.parsed.unit, ""), base.units[:1], linear=False).agree


def follows(motion: Array, command: Array, runs: Iterable[slice] = (slice(None),)) -> bool:
    """Whether a motion is large where the command is, as a velocity is; the slope of a position is rather so."""
    if motion.size != command.size or (together := _together(motion, command)) <= _FOLLOWS:
        return False
    slopes, means = slopes_and_means([motion, command], runs)
    return together > _together(slopes[:, 0], means[:, 1])


def _together(one: Array, other: Array) -> float:
    """Correlation without its sign; 0 where one of them stands still."""
    known = np.isfinite(one) & np.isfinite(other)
    if known.sum() < 3 or not (np.ptp(one[known]) and np.ptp(other[known])):
        return 0.0
    return abs(float(np.corrcoef(one[known], other[known])[0, 1]))


def longest_way(position: Array, runs: Iterable[slice]) -> slice:
    """Return the run in which the position moves furthest, which shows most."""
    return max(runs, key=lambda run: float(np.nan_to_num(np.ptp(position[run]))))
