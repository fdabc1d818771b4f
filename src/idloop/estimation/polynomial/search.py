"""Prediction errors of a polynomial model with their exact gradients, and the search for the least."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from idloop.arrays import Array, Mask
from idloop.errors import IdloopError
from idloop.estimation.linear.least_squares import column_sizes, rows_in_blocks, triangle
from idloop.estimation.optimisation.levenberg import minimise
from idloop.estimation.polynomial.polynomials import Orders, radius
from idloop.estimation.polynomial.regression import Channel, first_row, inverse_factor, lagged

_RESTARTS = 5  # starts that are followed
_DRAFT_ROWS = 20_000  # samples on which rival starts are compared
_ROUNDS = 8
_FLAT = 1e-11  # directions that change the errors by less than this part of the steepest are rounding
_FLOOR = 1e-11  # errors below this part of the output are rounding


class _Parts(NamedTuple):
    a: Array
    b: list[Array]
    c: Array
    d: Array
    f: list[Array]


@dataclass(frozen=True, eq=False)
class _Run:
    """Signals of one experiment under one set of coefficients."""

    error: Array  # from the sample `start` on
    plant: list[Array]  # B_i / F_i u_i from the sample `known` on
    disturbance: Array  # A y - sum of plant, from the sample `known` on
    transients: Array  # orthonormal columns that the unknown past spans, over the first rows of `error`


class Objective:
    """Errors e = D / C (A y - sum_i B_i / F_i u_i) of one output over several experiments.

    Each experiment starts where the lagged signals are known; the free
    responses of F and C, which carry the rest of the past, are fitted by projection (variable projection: Golub
    and Pereyra, SIAM J. Numer. Anal. 10, 1973; the slopes have Kaufman's form, whose gradient is exact).

    `spread` (k, r): the k coefficients are `offset` + `spread` @ x: ties or fixes some of them; `offset` (k,);
    `integrating`: whether C, too, may have roots on the unit circle.
    """

    def __init__(
        self,
        data: Sequence[Channel],
        orders: Orders,
        spread: Array | None = None,
        offset: Array | None = None,
        *,
        integrating: bool = False,
    ) -> None:
        self.data = list(data)
        self.orders = orders
        self.spread = np.eye(orders.size) if spread is None else spread
        self.offset = np.zeros(orders.size) if offset is None else offset
        self.known = first_row(orders)
        self.start = self.known + orders.nd
        longest = max(len(channel.output) for channel in self.data)
        # A root here makes the response grow by e squared over the record: allowed, for estimates of an integrator.
        self.plant_limit = 1.0 + 2.0 / longest
        # The predictor must be stable; at 1 - 0.1 / N it hardly decays within the record.
        self.noise_limit = self.plant_limit if integrating else 1.0 - 0.1 / longest

    @property
    def rows(self) -> int:
        """Number of errors."""
        return sum(max(len(channel.output) - self.start, 0) for channel in self.data)

    @property
    def past(self) -> int:
        """Numbers fitted for the initial conditions."""
        return len(self.data) * (sum(self.orders.nf) + self.orders.nc)

    def coefficients(self, free: Array) -> Array:
        """All coefficients from the free ones."""
        return np.asarray(self.offset + self.spread @ free)

    def stable(self, coefficients: Array) -> bool:
        """Whether the predictor does not run away on this record."""
        parts = self._parts(coefficients)
        return radius(parts.c) <= self.noise_limit and all(radius(f) <= self.plant_limit for f in parts.f)

    def errors(self, coefficients: Array) -> list[Array]:
        """Prediction errors of each experiment; infinite where the predictor is unstable."""
        if not self.stable(coefficients):
            return [np.full(max(len(channel.output) - self.start, 0), np.inf) for channel in self.data]
        parts = self._parts(coefficients)
        return [self._run(channel, parts).error for channel in self.data]

    def slopes(self, coefficients: Array) -> list[Array]:
        """Derivatives of the errors by the free coefficients, shape (n_i, r) each.

        Ljung, System Identification, 2nd ed., eq. 10.56 to 10.60 (there of the prediction).
        """
        from scipy.signal import lfilter

        parts = self._parts(coefficients)
        orders, known, start = self.orders, self.known, self.start
        result = []
        for channel in self.data:
            run = self._run(channel, parts)
            rows = len(run.error)
            jacobian = np.zeros((rows, orders.size))
            if orders.na:
                filtered = lfilter(parts.d, parts.c, channel.output)
                jacobian[:, orders.a] = lagged(filtered, range(1, orders.na + 1), start)
            for i, (nb, nf, nk) in enumerate(zip(orders.nb, orders.nf, orders.nk, strict=True)):
                if nb:
                    filtered = lfilter(parts.d, parts.c, lfilter([1.0], parts.f[i], channel.inputs[:, i]))
                    jacobian[:, orders.b(i)] = -lagged(filtered, range(nk, nk + nb), start)
                if nf:
                    filtered = lfilter(parts.d, parts.c, lfilter([1.0], parts.f[i], run.plant[i]))
                    jacobian[:, orders.f(i)] = lagged(filtered, range(1, nf + 1), start - known)
            if orders.nc:
                jacobian[:, orders.c] = -lagged(lfilter([1.0], parts.c, run.error), range(1, orders.nc + 1), 0)
            if orders.nd:
                filtered = lfilter([1.0], parts.c, run.disturbance)
                jacobian[:, orders.d] = lagged(filtered, range(1, orders.nd + 1), start - known)
            free = jacobian @ self.spread
            span = run.transients
            free[: len(span)] -= span @ (span.T @ free[: len(span)])
            result.append(free)
        return result

    def _parts(self, coefficients: Array) -> _Parts:
        orders, one = self.orders, np.ones(1)
        inputs = range(orders.inputs)
        return _Parts(
            np.concatenate([one, coefficients[orders.a]]),
            [np.concatenate([np.zeros(orders.nk[i]), coefficients[orders.b(i)]]) for i in inputs],
            np.concatenate([one, coefficients[orders.c]]),
            np.concatenate([one, coefficients[orders.d]]),
            [np.concatenate([one, coefficients[orders.f(i)]]) for i in inputs],
        )

    def _run(self, channel: Channel, parts: _Parts) -> _Run:
        from scipy.signal import lfilter

        orders, known = self.orders, self.known
        disturbance = lfilter(parts.a, [1.0], channel.output)[known:]
        plant = []
        for i, (numerator, denominator) in enumerate(zip(parts.b, parts.f, strict=True)):
            driven = np.zeros(len(disturbance))
            if orders.nb[i]:
                driven = lfilter([1.0], denominator, lfilter(numerator, [1.0], channel.inputs[:, i])[known:])
            plant.append(driven)
            disturbance = disturbance - driven
        error = self._whitened(disturbance, parts)
        if self.past == 0:
            return _Run(error, plant, disturbance, np.zeros((0, 0)))
        columns = self._transients(parts, len(error))
        reach = len(columns)
        scale = column_sizes(columns)
        span, factor = np.linalg.qr(columns / scale)
        along = span.T @ error[:reach]
        error = error.copy()
        error[:reach] -= span @ along
        share = np.linalg.lstsq(factor, -along, rcond=1e-12)[0] / scale
        place = 0
        for i, nf in enumerate(orders.nf):
            if nf:
                kick = np.zeros(len(plant[i]))
                kick[:nf] = share[place : place + nf]
                past = lfilter([1.0], parts.f[i], kick)
                plant[i] = plant[i] + past
                disturbance = disturbance - past
                place += nf
        return _Run(error, plant, disturbance, span)

    def _whitened(self, disturbance: Array, parts: _Parts) -> Array:
        from scipy.signal import lfilter

        moving = lfilter(parts.d, [1.0], disturbance)[self.start - self.known :]
        return np.asarray(lfilter([1.0], parts.c, moving))

    def _transients(self, parts: _Parts, rows: int) -> Array:
        """What the unknown past leaves in the errors: responses of each 1 / F and of 1 / C to single pulses."""
        from scipy.signal import lfilter

        skip = self.start - self.known
        size = max(radius(parts.c), *(radius(f) for f in parts.f), 0.0)
        if size < 1.0:
            # Beyond this nothing is left, multiple roots allowed for.
            order = sum(self.orders.nf) + self.orders.nc
            rows = min(rows, 10 * order + 10 + int(40.0 / -np.log(max(size, 1e-9))))
        pulse = np.zeros(rows + skip)
        pulse[0] = 1.0
        columns = []
        for nf, denominator in zip(self.orders.nf, parts.f, strict=True):
            if nf:
                response = -lfilter(parts.d, parts.c, lfilter([1.0], denominator, pulse))
                columns.append(lagged(response, range(nf), skip))
        if self.orders.nc:
            response = lfilter([1.0], parts.c, pulse[:rows])
            columns.append(lagged(response, range(self.orders.nc), 0))
        return np.hstack(columns)


@dataclass(frozen=True, eq=False)
class Found:
    """Where the search ended."""

    free: Array  # shape (r,): free coefficients
    squares: float  # sum of squared errors
    converged: bool


@dataclass(frozen=True, eq=False)
class Information:
    """Information of the data on the coefficients at the minimum."""

    factor: Array  # shape (r, s): W with W W^T the inverse of the sum of psi psi^T
    undetermined: Mask  # shape (r,): coefficients that the data leave open
    scores: list[Array]  # shape (n_i, s): psi(t)^T W e(t) of each experiment


def best(objective: Objective, starts: Sequence[Array]) -> Found:
    """Follow the most promising starts to their minima and keep the lowest."""
    draft = _shortened(objective)
    valued = sorted(((value, index) for index, s in enumerate(starts) if np.isfinite(value := _squares(draft, s))))
    if not valued:
        raise IdloopError("no stable predictor of these orders was found; try other orders or delays")
    # Starts of the same error are the same start.
    distinct = [valued[0], *(b for a, b in pairwise(valued) if b[0] > (1.0 + 1e-6) * a[0])]
    ends = [_descend(draft, starts[index], rounds=2) for _, index in distinct[:_RESTARTS]]
    lowest = min(ends, key=lambda end: end.squares)
    return _descend(objective, lowest.free, rounds=_ROUNDS)


def information(objective: Objective, free: Array) -> Information:
    """Information, what it leaves open, and the scores for standard errors that hold under coloured errors."""
    coefficients = objective.coefficients(free)
    slopes = objective.slopes(coefficients)
    factor, undetermined = inverse_factor(_triangle(slopes))
    errors = objective.errors(coefficients)
    scores = [(jacobian @ factor) * error[:, None] for jacobian, error in zip(slopes, errors, strict=True)]
    return Information(factor, undetermined, scores)


def _descend(objective: Objective, start: Array, rounds: int) -> Found:
    """Levenberg-Marquardt in coordinates of one standard error each, which are renewed until they hold."""
    free, squares = start, _squares(objective, start)
    size = float(np.sqrt(sum(float(c.output @ c.output) for c in objective.data)))
    converged = False
    for _ in range(rounds):
        sigma = float(np.sqrt(squares / max(objective.rows, 1)))
        if np.sqrt(squares) <= _FLOOR * size:
            return Found(free, squares, True)
        axes = _axes(_triangle(objective.slopes(objective.coefficients(free)))) * sigma
        centre, unbounded = free, np.full(axes.shape[1], np.inf)

        def residual(z: Array, centre: Array = centre, axes: Array = axes, sigma: float = sigma) -> Array:
            return np.concatenate(objective.errors(objective.coefficients(centre + axes @ z))) / sigma

        def slope(z: Array, centre: Array = centre, axes: Array = axes, sigma: float = sigma) -> Array:
            stacked = np.vstack(objective.slopes(objective.coefficients(centre + axes @ z)))
            return np.asarray(stacked @ (axes / sigma))

        end = minimise(
            residual, np.zeros(len(unbounded)), -unbounded, unbounded, np.ones(len(unbounded)),
            max_iterations=25, derivative=slope, tolerance=1e-6,
        )  # fmt: skip
        before, squares = squares, min(2.0 * end.cost * sigma**2, squares)
        free = centre + axes @ end.point
        # Errors that shrank have a finer unit, in which the search continues.
        converged = end.converged
        if converged and before - squares <= 1e-3 * before / max(objective.rows, 1):
            break
        if not converged and before - squares <= 1e-9 * before:
            break
    return Found(free, squares, converged)


def _axes(factor: Array) -> Array:
    """Directions in which the errors change by one unit each; what the errors do not feel stays where it is."""
    scale = column_sizes(factor)
    _, values, right = np.linalg.svd(factor / scale, full_matrices=False)
    keep = values > _FLAT * max(float(values[0]), 1e-300)
    return np.asarray((right[keep].T / values[keep]) / scale[:, None])


def _triangle(slopes: Sequence[Array]) -> Array:
    return triangle(s[first:last] for s in slopes for first, last in rows_in_blocks(len(s), 0))


def _squares(objective: Objective, free: Array) -> float:
    value = sum(float(e @ e) for e in objective.errors(objective.coefficients(free)))
    return value if np.isfinite(value) else np.inf


def _shortened(objective: Objective) -> Objective:
    """The same objective on the first part of long experiments."""
    total = sum(len(c.output) for c in objective.data)
    if total <= 2 * _DRAFT_ROWS:
        return objective
    share = _DRAFT_ROWS / total
    least = 20 * (objective.start + objective.orders.size)
    cut = [max(int(share * len(c.output)), min(least, len(c.output))) for c in objective.data]
    data = [Channel(c.output[:n], c.inputs[:n]) for c, n in zip(objective.data, cut, strict=True)]
    shorter = Objective(data, objective.orders, objective.spread, objective.offset)
    # The roots must stay where the whole record allows them.
    shorter.plant_limit, shorter.noise_limit = objective.plant_limit, objective.noise_limit
    return shorter
