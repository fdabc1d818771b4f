"""Prediction errors of a polynomial model, and their exact slopes by compiled filters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.polynomial.channels import Channel, Initial, first_row
from idloop.estimation.polynomial.orders import Orders
from idloop.estimation.polynomial.regression import lagged
from idloop.estimation.polynomial.stability import radius

Array = NDArray[np.float64]


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

    With the initial conditions estimated, each experiment starts where the lagged signals are known; the free
    responses of F and C, which carry the rest of the past, are fitted by projection (variable projection: Golub
    and Pereyra, SIAM J. Numer. Anal. 10, 1973; the slopes have Kaufman's form, whose gradient is exact).

    `spread` (k, r): the k coefficients are `offset` + `spread` @ x: ties or fixes some of them; `offset` (k,);
    `integrating`: whether C, too, may have roots on the unit circle.
    """

    def __init__(
        self,
        data: Sequence[Channel],
        orders: Orders,
        initial: Initial = "estimate",
        spread: Array | None = None,
        offset: Array | None = None,
        *,
        integrating: bool = False,
    ) -> None:
        self.data = list(data)
        self.orders = orders
        self.initial: Initial = initial
        self.spread = np.eye(orders.size) if spread is None else spread
        self.offset = np.zeros(orders.size) if offset is None else offset
        self.known = first_row(orders, initial)
        self.start = self.known + (orders.nd if initial == "estimate" else 0)
        longest = max(len(channel.output) for channel in self.data)
        # A root this far out grows by e squared over the record: an integrator's estimate may.
        self.plant_limit = 1.0 + 2.0 / longest
        # A predictor must forget; at 1 - 0.1 / N it just does not within the record.
        self.noise_limit = self.plant_limit if integrating else 1.0 - 0.1 / longest

    @property
    def rows(self) -> int:
        """Number of errors."""
        return sum(max(len(channel.output) - self.start, 0) for channel in self.data)

    @property
    def past(self) -> int:
        """Numbers fitted for the initial conditions."""
        return len(self.data) * (sum(self.orders.nf) + self.orders.nc) if self.initial == "estimate" else 0

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
        if self.initial == "zero" or self.past == 0:
            return _Run(error, plant, disturbance, np.zeros((0, 0)))
        columns = self._transients(parts, len(error))
        reach = len(columns)
        scale = np.linalg.norm(columns, axis=0)
        scale[scale == 0.0] = 1.0
        span, triangle = np.linalg.qr(columns / scale)
        along = span.T @ error[:reach]
        error = error.copy()
        error[:reach] -= span @ along
        share = np.linalg.lstsq(triangle, -along, rcond=1e-12)[0] / scale
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
