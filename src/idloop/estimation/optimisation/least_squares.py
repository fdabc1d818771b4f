"""Least-squares problem of a criterion: whitened and weighted residuals."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import IdloopError
from idloop.estimation.criterion import Criterion, Errors
from idloop.estimation.statistics.whitening import Whitener, choose_order, fit_whitener


class LeastSquaresProblem:
    """A criterion with the weights and whitening orders of its noise model.

    `parameters`: number of model parameters; nuisance parameters follow them in a point.
    `whiteners`: fixed whitening, one for each group of outputs.
    `floors`: least standard deviation of the errors by group and output, so that rounding of exact data is not
    significant.

    Notes
    -----
    The whitening coefficients are estimated at every point (variable projection): the Jacobian, and with it the
    covariance, leaves out what the noise model explains as well.
    """

    def __init__(
        self,
        criterion: Criterion,
        parameters: int,
        whiteners: list[Whitener] | None = None,
        floors: list[Array] | None = None,
    ) -> None:
        self.criterion, self.parameters, self.given, self.floors = criterion, parameters, whiteners, floors
        self.orders: list[int] = []
        self.weights: list[Array] = []
        self.objective = np.inf
        self.length = 0
        self.instants: list[int] = []  # by group, including those without a complete past
        self._whiteners: list[Whitener] = []

    def errors(self, point: Array) -> Errors:
        """Errors by group and record."""
        return self.criterion.errors(point[: self.parameters], point[self.parameters :])

    def whitened(self, point: Array) -> Errors:
        """Errors after whitening of the present orders."""
        errors = self.errors(point)
        if not self.orders:
            return errors
        if self.given is not None:
            return [[w.apply(e) for e in group] for group, w in zip(errors, self.given, strict=True)]
        return [self._whitener(group, order)[1] for group, order in zip(errors, self.orders, strict=True)]

    @staticmethod
    def _whitener(group: list[Array], order: int) -> tuple[Whitener, list[Array]]:
        if order == 0 or not all(np.all(np.isfinite(e)) for e in group):
            return Whitener(np.zeros((0, group[0].shape[1], group[0].shape[1]))), [e[order:] for e in group]
        whitener = fit_whitener(group, order)
        return whitener, [whitener.apply(e) for e in group]

    def reweigh(self, point: Array, whiten: bool, orders: list[int] | None = None) -> None:
        """Estimate orders and weights from the errors at a point; given orders are kept."""
        errors = self.errors(point)
        if self.given is not None:
            orders = [w.order for w in self.given]
        self.orders = orders or [choose_order(group) if whiten else 0 for group in errors]
        self.weights, self._whiteners, self.instants = [], [], [sum(len(e) for e in group) for group in errors]
        self.objective, self.length = 0.0, 0
        for place, (raw, order) in enumerate(zip(errors, self.orders, strict=True)):
            whitener, group = self._whitener(raw, order)
            if self.given is not None:
                whitener = self.given[place]
                group = [whitener.apply(e) for e in raw]
            self._whiteners.append(whitener)
            stacked = np.concatenate(group)
            self.length += stacked.size
            covariance = stacked.T @ stacked / max(len(stacked), 1)
            if self.floors is not None:
                covariance = covariance + np.diag(np.maximum(self.floors[place] ** 2 - np.diag(covariance), 0.0))
            # Outputs without any error must not get infinite weight.
            floor = max(1e-24 * float(np.max(np.diag(covariance))), 1e-60)
            covariance = covariance + floor * np.eye(len(covariance))
            self.weights.append(np.linalg.inv(np.linalg.cholesky(covariance)))
            self.objective += len(stacked) * float(np.linalg.slogdet(covariance)[1])

    @property
    def loss(self) -> float:
        """Determinant of the innovation covariance, product over the groups."""
        return float(np.prod([1.0 / np.linalg.det(w) ** 2 for w in self.weights]))

    def residual(self, point: Array) -> Array:
        """Whitened errors in units of their standard deviation, as one vector."""
        parts = [
            (e @ weight.T).ravel()
            for group, weight in zip(self.whitened(point), self.weights, strict=True)
            for e in group
        ]
        return np.concatenate(parts)

    def weighted_jacobian(self, slopes: Errors) -> Array:
        """Jacobian (n, k) of the residual from slopes (k, samples, outputs) of raw errors by group and record."""
        rows = sum(part.shape[1] * part.shape[2] for group in slopes for part in group)
        weighed: Array = np.empty((len(slopes[0][0]), rows))
        row = 0
        for group, weight in zip(slopes, self.weights, strict=True):
            for part in group:
                columns, samples, outputs = part.shape
                flat = (part.reshape(-1, outputs) @ weight.T).reshape(columns, -1)
                weighed[:, row : row + samples * outputs] = flat
                row += samples * outputs
        return np.asarray(weighed.T)

    def reweighted_jacobian(self, jacobian: Array, weights: list[Array]) -> Array:
        """Jacobian (n, k) of an unwhitened residual under the present weights, from that under earlier ones."""
        carried, row = np.empty_like(jacobian), 0
        for before, now, instants in zip(weights, self.weights, self.instants, strict=True):
            change, part = now @ np.linalg.inv(before), slice(row, row + instants * len(now))
            for column in range(jacobian.shape[1]):
                carried[part, column] = (jacobian[part, column].reshape(instants, -1) @ change.T).ravel()
            row = part.stop
        return carried

    def residual_or_infinite(self, point: Array, *, frozen: bool = False) -> Array:
        """As `residual`, or `frozen_residual`; infinite where the model cannot be simulated."""
        try:
            return self.frozen_residual(point) if frozen else self.residual(point)
        except (IdloopError, np.linalg.LinAlgError):
            return np.full(self.length, np.inf)

    def frozen_residual(self, point: Array) -> Array:
        """Residual with the whitening coefficients of the last `reweigh`."""
        return self.whiten(self.errors(point))

    def whiten(self, errors: Errors) -> Array:
        """Errors of any model, with whitening and weights of the last `reweigh`."""
        groups = zip(errors, self._whiteners, self.weights, strict=True)
        return np.concatenate([(w.apply(e) @ v.T).ravel() for group, w, v in groups for e in group])

    def scores(self, point: Array, residual: Array, jacobian: Array) -> list[Array]:
        """Scores of every sample, Jacobian times residual, by group and record."""
        scores = []
        row = 0
        for group in self.whitened(point):
            for e in group:
                n, p = e.shape
                part = slice(row, row + n * p)
                product = jacobian[part] * residual[part, None]
                scores.append(product.reshape(n, p, jacobian.shape[1]).sum(axis=1))
                row += n * p
        return scores

    def rows_of_records(self, point: Array) -> list[Integers]:
        """Rows of the residual by record, of all groups of outputs."""
        found: dict[int, list[Integers]] = {}
        row = 0
        for group in self.whitened(point):
            for record, e in enumerate(group):
                found.setdefault(record, []).append(np.arange(row, row + e.size))
                row += e.size
        return [np.concatenate(rows) for rows in found.values()]

    def segments(self, point: Array, count: int) -> list[Integers]:
        """Rows of the residual by segment of time, about ``count`` segments in all."""
        errors = self.whitened(point)
        lengths = [len(e) for e in errors[0]]
        parts = [max(round(count * n / max(sum(lengths), 1)), 1) for n in lengths]
        found: list[list[Integers]] = [[] for _ in range(sum(parts))]
        row = 0
        for group in errors:
            place = 0
            for e, number in zip(group, parts, strict=True):
                n, p = e.shape
                edges = np.linspace(0, n, number + 1).astype(np.int64) * p + row
                for k in range(number):
                    found[place + k].append(np.arange(edges[k], edges[k + 1]))
                place += number
                row += n * p
        return [np.concatenate(rows) for rows in found]

    def count(self, point: Array) -> int:
        """Number of instants."""
        return sum(len(e) for group in self.whitened(point) for e in group)
