"""How the acceleration of an axis follows its command, beside friction, springs and constant forces.

The balance of forces is taken in weak form: multiplied by smooth test functions and integrated, so that no
acceleration is computed (Messenger and Bortz 2021). Its errors come from a jackknife over parts of the record, which
coloured noise and forces that the balance lacks widen. The width of the test functions is the one with the most certain
gain.

A body behind an elastic coupling, which nobody measures, adds a resonance: the balance then holds with higher
derivatives of the motion, and the second of the command, beside it. Both forms are tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import factorial
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from idloop.arrays import Array, Integers, Mask
from idloop.records.inspection.axis import Axis, Grid

# Widths of the test functions [samples], and rows needed; rows overlap by three quarters.
_WIDTHS = (9, 17, 33, 65, 129, 257, 513)
_FEWEST, _OVERLAP = 48, 4
_PARTS = 12  # of a record for the jackknife
# The motion follows the command beyond doubt from this share of the acceleration and these standard errors of the gain
# on, where less than the last share of the command follows from speed, friction and position.
_VISIBLE, _BEYOND_DOUBT, _MADE_OF_MOTION = 0.3, 6.0, 0.8
# Gains differ by so many standard errors of their difference, and by this share of the larger.
_DIFFERENCE, _DIFFER = 5.0, 0.25
_POSITION = 3  # its column beside the command, where it is recorded
# Powers of the test functions (1 - s^2)^p: enough derivatives for the balance, and for that with a resonance.
_PLAIN, _SMOOTH = 3, 6


@cache
def _weights(width: int, power: int, derivative: int) -> Array:
    """Weights (width,) of the mean of a derivative over a test function of width 2."""
    x = (np.arange(width) - 0.5 * (width - 1)) / (0.5 * width)
    base = np.polynomial.Polynomial([1.0, 0.0, -1.0]) ** power
    weight = (base.deriv(derivative) if derivative else base)(x)
    # Exact for polynomials: no lower power of time passes, the power itself does.
    lower = x[:, None] ** np.arange(derivative)
    weight -= lower @ np.linalg.lstsq(lower, weight, rcond=None)[0]
    return np.asarray(weight * (factorial(derivative) / float(np.sum(weight * x**derivative))))


@dataclass(frozen=True, eq=False)
class Projection:
    """Projection of signals on an even grid onto smooth test functions of one width."""

    width: int
    period: float
    power: int = _PLAIN

    def kernel(self, derivative: int) -> Array:
        """Weights (width,) whose sum with a signal is the mean of its derivative over a test function."""
        return _weights(self.width, self.power, derivative) / (0.5 * self.width * self.period) ** derivative

    def project(self, value: Array, derivative: int = 0) -> Array:
        """Mean of a derivative of a signal (n,) over each test function, shape (rows,)."""
        windows = np.lib.stride_tricks.sliding_window_view(value, self.width)[:: max(self.width // _OVERLAP, 1)]
        return np.asarray(windows @ self.kernel(derivative))


class Gain(NamedTuple):
    """Acceleration per command, its standard error, and the share of the acceleration that the command explains."""

    value: float
    error: float
    share: float

    @property
    def certainty(self) -> float:
        """Gain in standard errors."""
        return self.value / self.error if self.error > 0.0 else 0.0

    def differs(self, other: Gain, least: float = _DIFFER) -> bool:
        """Whether two gains differ beyond chance, and by at least this share of the larger."""
        off = abs(self.value - other.value)
        chance = _DIFFERENCE * float(np.hypot(self.error, other.error))
        return off > chance and off > least * max(abs(self.value), abs(other.value))


@dataclass(frozen=True, eq=False)
class Response:
    """The weak balance ``acceleration = gain command + friction + spring + constant``."""

    # Acceleration per command, and its standard error
    gain: float
    error: float
    share: float  # share of the power of the acceleration, beside the other terms, that the command explains
    # Share of the power of the command that follows from speed, friction and position: all of it where the excitation
    # is slow
    motion_share: float
    functions: Projection
    # shape (rows,)
    acceleration: Array
    command: Array
    others: Array  # shape (rows, k): speed, its sign, constant, position where recorded, and what a resonance adds
    known: Mask  # rows without a hole

    @property
    def certainty(self) -> float:
        """Gain in standard errors."""
        return Gain(self.gain, self.error, self.share).certainty

    @property
    def is_plain(self) -> bool:
        """Whether the balance is the one without a resonance."""
        return self.functions.power == _PLAIN

    def gain_of(self, rows: Integers | None = None, *, beside_position: bool = False) -> Gain:
        """Gain over some rows, all that are known by default.

        Beside any smooth force over the position, such as the weight of an arm, where that is asked for.
        """
        place = self.others[:, _POSITION:][:, :1]
        over = [place**2, place**3, np.sin(place), np.cos(place)] if beside_position and place.size else []
        which = np.flatnonzero(self.known) if rows is None else rows
        target, table = self.acceleration[which], np.column_stack([self.command, self.others, *over])[which]
        values, errors, left = regress(target, table)
        return Gain(float(values[0]), float(errors[0]), own_share(target, table, left))

    def with_terms(self, first: Array, further: Sequence[Array]) -> tuple[Array, Array]:
        """Acceleration and table of its rows without a hole, with further signals (n,) on the grid in the balance.

        The columns of the table are the first signal, the command, the other terms, and the further signals.
        """
        added = [self.functions.project(one) for one in further]
        table = np.column_stack([self.functions.project(first), self.command, self.others, *added])
        known = self.known & np.isfinite(table).all(axis=1)
        return self.acceleration[known], table[known]


def dry(grid: Grid) -> Array:
    """Sign of the speed, smooth where it is lost in noise."""
    width = max(3.0 * grid.noise, 0.02 * float(np.nanstd(grid.speed)), 1e-300)
    return np.asarray(np.tanh(grid.speed / width))


def curved_friction(grid: Grid) -> list[Array]:
    """A drag that grows faster than the speed, and friction that falls with it."""
    fading = np.exp(-np.abs(grid.speed) / max(float(np.nanstd(grid.speed)), 1e-300))
    return [grid.speed * np.abs(grid.speed), dry(grid) * fading]


def position_forces(grid: Grid) -> list[Array]:
    """Smooth forces over the position, such as the weight of an arm; none without a position."""
    place = grid.position - np.nanmean(grid.position) if np.isfinite(grid.position).any() else None
    return [] if place is None else [place**2, place**3, np.sin(place), np.cos(place)]


def beyond(command: Array, level: float) -> Array:
    """Part of a command (n,) beyond a level."""
    return np.asarray(np.sign(command) * np.maximum(np.abs(command) - level, 0.0))


def regress(target: Array, table: Array) -> tuple[Array, Array, float]:
    """Least squares with jackknife errors over parts of the rows.

    Returns `values`, `errors` (k,).
    and `left`: mean square of the residuals.
    """
    size = np.maximum(np.sqrt(np.mean(table**2, axis=0)), 1e-300)
    scaled = table / size
    parts = np.array_split(np.arange(target.size), _PARTS)
    squares = np.array([scaled[part].T @ scaled[part] for part in parts])
    products = np.array([scaled[part].T @ target[part] for part in parts])
    whole, product = squares.sum(axis=0), products.sum(axis=0)
    values, *others = _solve(np.array([whole, *(whole - squares)]), np.array([product, *(product - products)]))
    errors = np.sqrt((_PARTS - 1.0) * np.var(others, axis=0))
    return values / size, errors / size, float(np.mean((target - scaled @ values) ** 2))


def unexplained(target: Array, table: Array) -> float:
    """Mean square of the residuals of least squares."""
    scaled = table / np.maximum(np.sqrt(np.mean(table**2, axis=0)), 1e-300)
    return float(np.mean((target - scaled @ _solve(scaled.T @ scaled, scaled.T @ target)) ** 2))


def own_share(target: Array, table: Array, left: float) -> float:
    """Share of what the other columns leave that the first one explains, by the residuals of all."""
    without = unexplained(target, table[:, 1:])
    return 1.0 - left / without if without > 0.0 else 0.0


def _solve(squares: Array, products: Array) -> Array:
    """Solve normal equations, one or a stack of them; directions that no row has are left out."""
    levels, vectors = np.linalg.eigh(squares)
    inverse = np.divide(1.0, levels, out=np.zeros_like(levels), where=levels > 1e-10 * levels[..., -1:])
    turned = vectors.swapaxes(-1, -2) @ products[..., None]
    return np.asarray((vectors @ (inverse[..., None] * turned))[..., 0])


_known: WeakKeyDictionary[Axis, list[Response]] = WeakKeyDictionary()


def responses(axis: Axis) -> list[Response]:
    """Return the balance over test functions of every width, for each measured signal."""
    if axis not in _known:
        _known[axis] = _responses(axis)
    return _known[axis]


def plain_responses(axis: Axis) -> list[Response]:
    """Return the balances without a resonance."""
    return [one for one in responses(axis) if one.is_plain]


def _responses(axis: Axis) -> list[Response]:
    grid = axis.grid
    if grid is None or not all(np.isfinite(one).any() for one in (grid.command, grid.speed)):
        return []
    if np.nanstd(grid.command) == 0.0:
        return []
    sources = [(grid.position, 2), *([(grid.velocity, 1)] if axis.trusts_velocity else [])]
    sources = [one for one in sources if np.isfinite(one[0]).any()]
    sign, found = dry(grid), []
    for width, power in [(width, power) for width in _WIDTHS for power in (_PLAIN, _SMOOTH)]:
        functions = Projection(width, grid.period, power)
        if grid.time.size < width + _FEWEST * max(width // _OVERLAP, 1):
            break
        command, speed, friction = (functions.project(one) for one in (grid.command, grid.speed, sign))
        columns = [command, speed, friction, np.ones(command.size)]
        place = functions.project(grid.position)
        if np.isfinite(place).any():
            columns.append(place - np.nanmean(place))
        for source, order in sources:
            resonance = []
            if power == _SMOOTH:
                resonance = [functions.project(source, order + 1), functions.project(source, order + 2)]
                resonance.append(functions.project(grid.command, 2))
            table = np.column_stack([*columns, *resonance])
            one = _response(functions.project(source, order), table, functions, len(columns))
            if one is not None:
                found.append(one)
    return found


def _response(acceleration: Array, table: Array, functions: Projection, plain: int) -> Response | None:
    """Solve one balance; the first `plain` columns of the table are those without a resonance."""
    known = np.isfinite(acceleration) & np.isfinite(table).all(axis=1)
    target, rows = acceleration[known], table[known]
    if known.sum() < _FEWEST or np.std(target) == 0.0 or np.std(rows[:, 0]) == 0.0:
        return None
    values, errors, left = regress(target, rows)
    return Response(
        gain=float(values[0]),
        error=float(errors[0]),
        share=own_share(target, rows, left),
        motion_share=1.0 - unexplained(rows[:, 0], rows[:, 1:plain]) / float(np.var(rows[:, 0])),
        functions=functions,
        acceleration=acceleration,
        command=table[:, 0],
        others=table[:, 1:],
        known=known,
    )


def response(axis: Axis, share: float = 0.0) -> Response | None:
    """Return the balance with the most certain gain, of those in which the command explains at least a share.

    None where there is none: without a command that changes, or with too few samples.
    """
    enough = [one for one in responses(axis) if one.share >= share]
    return max(enough, key=lambda one: abs(one.certainty), default=None)


def visible_response(axis: Axis) -> Response | None:
    """Return the balance that shows beyond doubt that the motion follows the command; None where none does.

    A command that a loop makes of speed and position follows from these, and shows nothing.
    """
    shown = [one for one in responses(axis) if one.share > _VISIBLE and one.motion_share < _MADE_OF_MOTION]
    best = max(shown, key=lambda one: one.certainty, default=None)
    return best if best is not None and best.certainty > _BEYOND_DOUBT else None
