"""Scores of unseen samples by a model that was fitted by prediction or by its free run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.evidence.predictive import FOLDS, Rows, Scores, deal, others
from idloop.estimation.likelihood.refit import Refit
from idloop.estimation.optimisation.levenberg import box_step
from idloop.estimation.statistics.student import log_density, scale_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Group:
    """Instants at which some outputs are measured together."""

    outputs: int
    # Log-determinant of the weights of their errors.
    level: float
    # First row of the residual that an instant has, shape (instants,); -1 where the whitening has no past for it.
    first: Rows
    # See `deal`, by instants.
    folds: list[Rows]
    blocks: list[Rows]

    def rows(self, instants: Rows) -> Rows:
        """Their rows of the residual, shape (instants with errors, outputs)."""
        first = self.first[instants]
        return first[first >= 0][:, None] + np.arange(self.outputs)

    def log_densities(self, residual: Array, rest: Rows, own: Rows) -> Array:
        """Of some instants, with the scale of the rest; NaN where there is no error."""
        total: Array = np.full(int(np.sum(self.first[own] >= 0)), self.level)
        for here, there in zip(residual[self.rows(own)].T, residual[self.rows(rest)].T, strict=True):
            total = total + log_density(here, scale_of(there))
        found = np.full(len(own), np.nan)
        found[self.first[own] >= 0] = total
        return found


class InnovationScores:
    """Scores of a refit, and of the same with further regressors for its errors.

    The fits on the other folds are linearised around the one to all.
    """

    def __init__(self, fit: Refit) -> None:
        self.fit, problem, point = fit, fit.problem, fit.point
        self.errors = fit.residual()
        # The noise model is that of all folds: its slopes hold for small changes only.
        self._sensitive = np.flatnonzero(fit.sensitive[: fit.parameters])
        slopes, lower, upper = (part[..., self._sensitive] for part in (fit.jacobian, *fit.model.bounds))
        self._size = np.linalg.norm(slopes, axis=0)
        self._slopes = slopes / self._size
        lower, upper = lower * self._size, upper * self._size
        self._box = np.clip(point[self._sensitive] * self._size, lower, upper), lower, upper
        self._groups: list[_Group] = []
        known = 0
        for raw, white, weight in zip(problem.errors(point), problem.whitened(point), problem.weights, strict=True):
            starts = np.concatenate([[0], np.cumsum([len(errors) for errors in raw])]).astype(np.int64)
            first, outputs = np.full(starts[-1], -1), len(weight)
            for end, errors in zip(starts[1:], white, strict=True):
                first[end - len(errors) : end] = known + outputs * np.arange(len(errors))
                known += outputs * len(errors)
            level = float(np.sum(np.log(np.abs(np.diag(weight)))))
            self._groups.append(_Group(outputs, level, first, *deal(starts)))

    def scores(self) -> Scores:
        """Log-density of every instant by a fit on the other folds.

        Instants that the whitening has no past for count as an average one.
        """

        def left(move: Array) -> Array:
            point = self.fit.point.copy()
            point[self._sensitive] = (self._box[0] + move) / self._size
            return self.fit.problem.residual_or_infinite(point, frozen=True)

        return self._scores(self._slopes, self._box, left)

    def beside(self, further: Array) -> Scores:
        """The same to first order, with regressors (n, c) of the errors fitted beside the parameters."""
        further = further / np.maximum(np.linalg.norm(further, axis=0), 1e-300)
        columns, free = np.hstack([self._slopes, further]), np.full(further.shape[1], np.inf)
        at, lower, upper = self._box
        box = np.append(at, np.zeros_like(free)), np.append(lower, -free), np.append(upper, free)
        return self._scores(columns, box, lambda move: self.errors + columns @ move)

    def _scores(self, columns: Array, box: tuple[Array, Array, Array], left: Callable[[Array], Array]) -> Scores:
        density = [np.full(len(group.first), np.nan) for group in self._groups]
        for index in range(FOLDS):
            rests = [others(group.folds, index) for group in self._groups]
            rows = np.concatenate([g.rows(rest).ravel() for g, rest in zip(self._groups, rests, strict=True)])
            part, known = columns[rows], float(np.sum(self.errors[rows] ** 2))
            # The damping only keeps the equations solvable.
            move, _ = box_step(part.T @ self.errors[rows], part.T @ part, 1e-9, *box)
            # The longest step that is no worse on the folds that it is fitted to.
            for share in (1.0, 0.5, 0.25, 0.0):
                errors = left(share * move)
                if float(np.sum(errors[rows] ** 2)) <= known:
                    break
            for group, rest, values in zip(self._groups, rests, density, strict=True):
                values[group.folds[index]] = group.log_densities(errors, rest, group.folds[index])
        found, blocks, before = [], [], 0
        for group, values in zip(self._groups, density, strict=True):
            known_ones = values[np.isfinite(values)]
            average = float(np.mean(known_ones)) if len(known_ones) else np.nan
            found.append(np.where(np.isfinite(values), values, average)[np.concatenate(group.folds)])
            blocks += [block + before for block in group.blocks]
            before += len(values)
        return Scores(np.concatenate(found), blocks, self.fit.initial_log_likelihood)
