"""Rival models on one scale: one noise model, what each has learnt so far, and what each would miss.

What an experiment would show is expected, not observed: with one rival as the truth its outputs are known,
and another rival's errors on them (innovations, or unexplained force) are what that rival cannot explain. Part of it a
refit would explain after all. The refit is linearised, and holds the parameters with the information of the
data so far, because those data have to be explained as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.design.rival_view import View
from idloop.estimation.optimisation.levenberg import difference_jacobian, minimise
from idloop.estimation.optimisation.solve import typical_size
from idloop.estimation.statistics.whitening import autocovariances, left_by_orders

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# Where a rival misses this much, taking it for a stronger disturbance can pay.
_PLAIN = 10.0
# Errors of a size at which their squares no longer add up.
_RUNS_AWAY = 1e100
# Lags of a noise model of its own, by which a rival may explain what it misses.
_MOST_LAGS = 8


@dataclass(frozen=True)
class Missed:
    """What one rival would miss of an experiment in which another one is the truth.

    Attributes
    ----------
    gain : float
        Expected log-likelihood by which the truth is ahead after the refit, the data so far held.
    alone : float
        The same from the experiment alone, as if the data so far were forgotten.
    theta : array, shape (k,)
        Parameters of the refitted rival.
    """

    gain: float
    alone: float
    theta: Array


class Rival:
    """A model with what the data so far say about its parameters.

    Parameters
    ----------
    label : str
        What sets it apart from the others.
    model : Model
        Fitted to the data so far.
    view : View
    """

    def __init__(self, label: str, model: Model, view: View) -> None:
        self.label, self.model, self.view, self.engine = label, model, view, view.engine
        self.theta = model.theta
        self.lower, self.upper = model.bounds
        self.scale = typical_size(self.theta, self.lower, self.upper)
        k = len(self.theta)
        self.root = np.zeros((k, k))
        self.step = 1e-4 * self.scale
        if k:
            base = view.seen(self.theta)
            jacobian, self.step = difference_jacobian(
                view.seen, self.theta, base, self.lower, self.upper, self.step, self.scale, central=False
            )
            self.root = _widened_root(jacobian, self._stated_errors())

    def _stated_errors(self) -> Array:
        """Standard errors that the fit has stated; NaN where none."""
        known = [self.model.parameter(name).stderr for name in self.model.free]
        return np.array([np.nan if value is None else value for value in known])

    def leaves(self, record: Record, start: float) -> Array:
        """Errors of this rival as it is on a record, shape (n, p)."""
        return self.view.innovations(record, start, self.theta)

    def missed(self, record: Record, start: float, own: Array, *, searched: bool = False) -> Missed:
        """What this rival misses of a record without noise, refitted to it and to the data so far.

        It may also take what it misses for a stronger disturbance, as a fit would.

        Parameters
        ----------
        record : Record
            From `Experiment.run` of the truth.
        start : float
            Where the axis rested before.
        own : array, shape (n, p)
            What the truth itself leaves of it, which is no motion that tells.
        searched : bool
            Refit by a search instead of one linear step: slower, and exact where the rival bends.
        """
        raw = self._with_slopes(record, start, own)
        if not np.all(np.abs(raw[:: self.view.period]) < _RUNS_AWAY):
            return Missed(np.inf, np.inf, self.theta)  # runs away where the truth does not: plainly told apart
        best, at = self._linear(raw, 0.0), 0.0
        for decades in self.view.stronger:
            if min(best.gain, best.alone) < _PLAIN:
                break
            other = self._linear(self.view.transferred(raw, decades), decades)
            if other.gain >= best.gain and other.alone >= best.alone:
                break
            if other.gain < best.gain:
                at = decades
            theta = other.theta if other.gain < best.gain else best.theta
            best = Missed(min(best.gain, other.gain), min(best.alone, other.alone), theta)
        return self._search(record, start, own, best, at) if searched and len(self.theta) else best

    def _with_slopes(self, record: Record, start: float, own: Array) -> Array:
        """Innovations, and their derivative by each parameter in units of its step, shape (n, p, 1 + k)."""
        base = self.leaves(record, start)
        raw = np.empty((*base.shape, 1 + len(self.theta)))
        raw[:, :, 0] = base - own
        for i, step in enumerate(self.step):
            moved = self.theta.copy()
            sign = 1.0 if moved[i] + step <= self.upper[i] else -1.0
            moved[i] += sign * step
            raw[:, :, 1 + i] = sign * (self.view.innovations(record, start, moved) - base)
        return raw

    def _linear(self, raw: Array, decades: float) -> Missed:
        """Refit by one linear step, with the data so far and without them."""
        white = self.view.scaled(raw, decades)
        base, jacobian = white[:, 0], white[:, 1:] / self.step
        theta, free = self._refitted(jacobian, base, 1.0), self._refitted(jacobian, base, 1e-6)
        gain = self._lost(base + jacobian @ (theta - self.theta), len(raw), decades)
        alone = self._lost(base + jacobian @ (free - self.theta), len(raw), decades)
        return Missed(gain + self._held(theta), alone, theta)

    def _held(self, theta: Array) -> float:
        """Log-likelihood of the data so far that a move of the parameters costs."""
        return 0.5 * float(np.sum((self.root @ (theta - self.theta)) ** 2))

    def _search(self, record: Record, start: float, own: Array, linear: Missed, decades: float) -> Missed:
        def residual(theta: Array) -> Array:
            raw = (self.view.innovations(record, start, theta, decades) - own)[:, :, None]
            return np.append(self.view.scaled(raw, decades)[:, 0], self.root @ (theta - self.theta))

        costs = [float(np.sum(residual(theta) ** 2)) for theta in (self.theta, linear.theta)]
        found = minimise(
            residual, linear.theta if costs[1] < costs[0] else self.theta, self.lower, self.upper, self.scale,
            self.step.copy(), max_iterations=6, tolerance=1e-2, quick=True,
        )  # fmt: skip
        left = found.residual[: len(found.residual) - len(self.theta)]
        gain = self._lost(left, len(own), decades) + self._held(found.point)
        return Missed(gain, linear.alone, found.point)

    def _refitted(self, jacobian: Array, base: Array, held: float) -> Array:
        """Least squares with a share of the information so far, in the bounds one parameter after the other."""
        k = len(self.theta)
        information = jacobian.T @ jacobian + held * self.root.T @ self.root
        size = np.sqrt(np.diag(information))
        size = np.where(size > 0.0, size, 1.0)
        hessian = information / np.outer(size, size)
        gradient = jacobian.T @ base / size
        free, shift = np.ones(k, dtype=bool), np.zeros(k)
        for _ in range(k):
            index = np.flatnonzero(free)
            if len(index) == 0:
                break
            own = hessian[np.ix_(index, index)] + 1e-10 * np.eye(len(index))
            fixed = hessian[np.ix_(index, np.flatnonzero(~free))] @ shift[~free]
            shift[index] = -np.linalg.solve(own, gradient[index] + fixed)
            inside = np.clip(self.theta + shift / size, self.lower, self.upper)
            beyond = free & (np.abs(inside - self.theta - shift / size) > 1e-9 * self.scale)
            if not np.any(beyond):
                break
            shift[beyond] = ((inside - self.theta) * size)[beyond]
            free &= ~beyond
        return np.clip(self.theta + shift / size, self.lower, self.upper)

    def _lost(self, left: Array, samples: int, decades: float) -> float:
        """Log-likelihood lost by what is left, the noise's covariance and colour being refitted as well."""
        lost, place = 0.0, 0
        for (count, outputs), own in zip(self.view.shapes(samples), self.view.noise_at(decades), strict=True):
            part = left[place : place + count * outputs].reshape(count, outputs)
            place += count * outputs
            if count > 20 * _MOST_LAGS:
                lost += _coloured_loss(part, own)
        return lost


def _coloured_loss(left: Array, own: Array) -> float:
    """Log-likelihood lost when white noise has something added that a noise model of its own may explain in part."""
    count, outputs = left.shape
    covariance = autocovariances([np.ascontiguousarray(left)], _MOST_LAGS)
    covariance[0] += own
    innovation = left_by_orders(covariance)
    losses = 0.5 * count * np.linalg.slogdet(innovation)[1] + np.arange(len(innovation)) * outputs**2
    return float(max(np.min(losses), 0.0))


def _widened_root(jacobian: Array, stated: Array) -> Array:
    """Root R of the information RᵀR that the data so far give, no sharper than the fit's own standard errors."""
    information = jacobian.T @ jacobian
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(size, size))
    values = np.where(values > 1e-10 * values[-1], values, 0.0)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * size
    # Standard errors by the inverse; what the data do not determine stays free.
    inverse = np.where(values > 0.0, 1.0 / np.where(values > 0.0, values, 1.0), 1e10)
    own = np.sqrt(np.sum(vectors**2 * inverse, axis=1)) / size
    wider = np.where(np.isfinite(stated) & (stated > own), stated / own, 1.0)
    return np.asarray(root / wider)
