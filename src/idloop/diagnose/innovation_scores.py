"""What a model that was fitted by prediction, or by its free run, says of samples that its fits have not seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.predictive import FOLDS, Scores, deal
from idloop.estimate.levenberg import box_step
from idloop.estimate.likelihood.refit import Refit
from idloop.estimate.likelihood.weighing import residual_or_infinite
from idloop.estimate.student import log_density, scale_of

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

# A fit to other folds begins beside the whole one: a damping that only keeps equations solvable.
_DAMPING = 1e-9
# Parts of the way to it that are tried until one is no worse on the folds that it is fitted to.
_SHARES = (1.0, 0.5, 0.25, 0.0)


@dataclass(frozen=True)
class _Group:
    """Instants at which some outputs are measured together.

    Attributes
    ----------
    first : int
        Place of their errors in the residual.
    shape : tuple of int
        Instants that have an error, and outputs.
    level : float
        Log-density that their weights stand for.
    place : array of int, shape (instants,)
        Which error an instant has; -1 where the whitening has no past for it.
    folds, blocks : list of array of int
        As of `deal`.
    """

    first: int
    shape: tuple[int, int]
    level: float
    place: Rows
    folds: list[Rows]
    blocks: list[Rows]

    def errors_of(self, instants: Rows) -> Rows:
        """Which errors some instants have."""
        place = self.place[instants]
        return place[place >= 0]

    def rows_of(self, instants: Rows) -> Rows:
        """Their rows of the residual."""
        outputs = self.shape[1]
        return (self.first + self.errors_of(instants)[:, None] * outputs + np.arange(outputs)).ravel()


class InnovationScores:
    """Scores of a refit, and of the same with further columns that its errors may follow.

    Parameters
    ----------
    fit : Refit
        Around which the fits on the other folds are linearised.
    """

    def __init__(self, fit: Refit) -> None:
        self.fit, problem, point = fit, fit.problem, fit.point
        self.errors = fit.residual()
        # The noise model is that of all folds: its slopes hold for small changes only, which those of a fold are not.
        self._felt = np.flatnonzero(fit.felt[: fit.parameters])
        slopes, lower, upper = (part[..., self._felt] for part in (fit.jacobian, *fit.model.bounds))
        self._size = np.linalg.norm(slopes, axis=0)
        self._slopes = slopes / self._size
        lower, upper = lower * self._size, upper * self._size
        self._box = np.clip(point[self._felt] * self._size, lower, upper), lower, upper
        self._groups: list[_Group] = []
        first = 0
        for raw, white, weight in zip(problem.errors(point), problem.whitened(point), problem.weights, strict=True):
            starts = np.concatenate([[0], np.cumsum([len(errors) for errors in raw])]).astype(np.int64)
            place, known = np.full(starts[-1], -1), 0
            for begin, before, after in zip(starts[:-1], raw, white, strict=True):
                lead = len(before) - len(after)
                place[begin + lead : begin + len(before)] = np.arange(known, known + len(after))
                known += len(after)
            level = float(np.sum(np.log(np.abs(np.diag(weight)))))
            self._groups.append(_Group(first, (known, len(weight)), level, place, *deal(starts)))
            first += known * len(weight)

    def scores(self) -> Scores:
        """Log-density of every instant by a fit on the other folds.

        Returns
        -------
        Scores
            Instants that the whitening has no past for count as an average one.
        """

        def left(move: Array) -> Array:
            point = self.fit.point.copy()
            point[self._felt] = (self._box[0] + move) / self._size
            return residual_or_infinite(self.fit.problem, point)

        return self._scores(self._slopes, self._box, left)

    def beside(self, further: Array) -> Scores:
        """The same to first order, with columns that the errors may follow fitted beside the parameters.

        Parameters
        ----------
        further : array, shape (n, c)

        Returns
        -------
        Scores
        """
        further = further / np.maximum(np.linalg.norm(further, axis=0), 1e-300)
        columns, free = np.hstack([self._slopes, further]), np.full(further.shape[1], np.inf)
        box = tuple(
            np.append(part, own) for part, own in zip(self._box, (np.zeros_like(free), -free, free), strict=True)
        )
        return self._scores(columns, box, lambda move: self.errors + columns @ move)

    def _scores(self, columns: Array, box: tuple[Array, ...], left: Callable[[Array], Array]) -> Scores:
        density = [np.full(len(group.place), np.nan) for group in self._groups]
        for index in range(FOLDS):
            others = [
                np.concatenate([fold for place, fold in enumerate(group.folds) if place != index])
                for group in self._groups
            ]
            rows = np.concatenate([g.rows_of(rest) for g, rest in zip(self._groups, others, strict=True)])
            part, known = columns[rows], float(np.sum(self.errors[rows] ** 2))
            at, lower, upper = box
            move, _ = box_step(part.T @ self.errors[rows], part.T @ part, _DAMPING, at, lower, upper)
            for share in _SHARES:
                errors = left(share * move)
                if float(np.sum(errors[rows] ** 2)) <= known:
                    break
            for group, rest, found in zip(self._groups, others, density, strict=True):
                found[group.folds[index]] = _log_densities(group, errors, rest, group.folds[index])
        return replace(_joined(self._groups, density), start=self.fit.at_start)


def _log_densities(group: _Group, residual: Array, others: Rows, own: Rows) -> Array:
    """Of the instants of one fold, with the scale of the others; NaN where there is no error."""
    count, outputs = group.shape
    errors = residual[group.first : group.first + count * outputs].reshape(count, outputs)
    known, found = group.place[own] >= 0, np.full(len(own), np.nan)
    total = np.full(int(np.sum(known)), group.level)
    for column in errors.T:
        total = total + log_density(column[group.errors_of(own)], scale_of(column[group.errors_of(others)]))
    found[known] = total
    return found


def _joined(groups: list[_Group], density: list[Array]) -> Scores:
    """In the order of the folds, group after group."""
    found, blocks, before = [], [], 0
    for group, values in zip(groups, density, strict=True):
        known = np.isfinite(values)
        average = float(np.mean(values[known])) if np.any(known) else np.nan
        found.append(np.where(known, values, average)[np.concatenate(group.folds)])
        blocks += [block + before for block in group.blocks]
        before += len(values)
    return Scores(np.concatenate(found), blocks)
