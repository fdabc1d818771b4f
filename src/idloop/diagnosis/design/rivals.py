"""Rival models: the log-likelihood that each is expected to lose in an experiment in which another one is the truth.

With one rival as the truth, its outputs are simulated; the errors of another rival on them (innovations, or unexplained
force) are what that rival cannot explain. A refit explains a part of them. The refit is linearised and uses the
information of the data so far, which have to be explained as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.design.rival_noise import MOST_LAGS
from idloop.estimation.optimisation.levenberg import difference_jacobian, minimise
from idloop.estimation.optimisation.solve import typical_size
from idloop.estimation.statistics.whitening import autocovariances, left_by_orders

if TYPE_CHECKING:
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.estimation.optimisation.caching_engine import CachingEngine
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# From this loss on a rival may gain by a stronger disturbance.
_LARGE_LOSS = 10.0
# Errors whose squares overflow.
_DIVERGED = 1e100


class RivalErrors(Protocol):
    """Errors of one rival on the data so far and on experiments, on the common scale of all rivals."""

    engine: CachingEngine

    @property
    def stronger(self) -> tuple[float, ...]:
        """Decades by which the disturbance may be taken for stronger than it is."""

    @property
    def period(self) -> int:
        """Everything is measured at every n-th instant."""

    def seen(self, theta: Array) -> Array:
        """Errors on the data so far as one vector, white and of unit variance by this rival's own noise."""

    def errors(self, record: Record, start: float, theta: Array, decades: float = 0.0) -> Array:
        """Errors on an experiment that began at rest at `start`, shape (n, p)."""

    def scaled(self, raw: Array, decades: float = 0.0) -> Array:
        """Series of such errors (n, p, k), white and of unit variance where the rival is right: (rows, k)."""

    def transferred(self, raw: Array, decades: float) -> Array:
        """The same errors under a stronger disturbance."""

    def noise_at(self, decades: float) -> list[Array]:
        """Covariance of the noise then, by group, in units of that of the right disturbance."""

    def shapes(self, samples: int) -> list[tuple[int, int]]:
        """Samples and outputs of each group in what `scaled` returns."""

    def differences(self, truth: Record, start: float, theta: Array, experiment: Experiment) -> dict[str, Any]:
        """Error by quantity in units of the machine: ``{name: {"value": ..., "unit": ..., "noise": ...}}``."""


@dataclass(frozen=True)
class ExpectedLoss:
    """What a rival is expected to lose in an experiment in which another one is the truth."""

    joint: float  # log-likelihood by which the truth leads after the refit, the data so far included
    alone: float  # the same from the experiment alone
    theta: Array  # parameters of the refitted rival, shape (k,)


class Rival:
    """A model fitted to the data so far, with their information about its parameters.

    `label` is what sets it apart from the others.
    """

    def __init__(self, label: str, model: Model, view: RivalErrors) -> None:
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

    def errors(self, record: Record, start: float) -> Array:
        """Errors of this rival, not refitted, on a record, shape (n, p)."""
        return self.view.errors(record, start, self.theta)

    def expected_loss(self, record: Record, start: float, own: Array, *, searched: bool = False) -> ExpectedLoss:
        """Loss on a noise-free record, refitted to it and to the data so far, or with a stronger disturbance.

        The record is simulated by the truth, whose own errors on it are `own`, shape (n, p). `searched` refits by a
        search instead of one linear step: slower, and exact where the rival is nonlinear in its parameters.
        """
        raw = self._with_slopes(record, start, own)
        if not np.all(np.abs(raw[:: self.view.period]) < _DIVERGED):
            return ExpectedLoss(np.inf, np.inf, self.theta)  # diverges where the truth does not
        best, at = self._linear(raw, 0.0), 0.0
        for decades in self.view.stronger:
            if min(best.joint, best.alone) < _LARGE_LOSS:
                break
            other = self._linear(self.view.transferred(raw, decades), decades)
            if other.joint >= best.joint and other.alone >= best.alone:
                break
            if other.joint < best.joint:
                at = decades
            theta = other.theta if other.joint < best.joint else best.theta
            best = ExpectedLoss(min(best.joint, other.joint), min(best.alone, other.alone), theta)
        return self._search(record, start, own, best, at) if searched and len(self.theta) else best

    def _with_slopes(self, record: Record, start: float, own: Array) -> Array:
        """Errors, and their derivative by each parameter in units of its step, shape (n, p, 1 + k)."""
        base = self.errors(record, start)
        raw = np.empty((*base.shape, 1 + len(self.theta)))
        raw[:, :, 0] = base - own
        for i, step in enumerate(self.step):
            moved = self.theta.copy()
            sign = 1.0 if moved[i] + step <= self.upper[i] else -1.0
            moved[i] += sign * step
            raw[:, :, 1 + i] = sign * (self.view.errors(record, start, moved) - base)
        return raw

    def _linear(self, raw: Array, decades: float) -> ExpectedLoss:
        """Refit by one linear step, with the data so far and without them."""
        white = self.view.scaled(raw, decades)
        base, jacobian = white[:, 0], white[:, 1:] / self.step
        theta, free = self._refitted(jacobian, base, 1.0), self._refitted(jacobian, base, 1e-6)
        gain = self._loss(base + jacobian @ (theta - self.theta), len(raw), decades)
        alone = self._loss(base + jacobian @ (free - self.theta), len(raw), decades)
        return ExpectedLoss(gain + self._prior_loss(theta), alone, theta)

    def _prior_loss(self, theta: Array) -> float:
        """Log-likelihood of the data so far that a move of the parameters costs."""
        return 0.5 * float(np.sum((self.root @ (theta - self.theta)) ** 2))

    def _search(self, record: Record, start: float, own: Array, linear: ExpectedLoss, decades: float) -> ExpectedLoss:
        def residual(theta: Array) -> Array:
            raw = (self.view.errors(record, start, theta, decades) - own)[:, :, None]
            return np.append(self.view.scaled(raw, decades)[:, 0], self.root @ (theta - self.theta))

        costs = [float(np.sum(residual(theta) ** 2)) for theta in (self.theta, linear.theta)]
        found = minimise(
            residual, linear.theta if costs[1] < costs[0] else self.theta, self.lower, self.upper, self.scale,
            self.step.copy(), max_iterations=6, tolerance=1e-2, quick=True,
        )  # fmt: skip
        left = found.residual[: len(found.residual) - len(self.theta)]
        gain = self._loss(left, len(own), decades) + self._prior_loss(found.point)
        return ExpectedLoss(gain, linear.alone, found.point)

    def _refitted(self, jacobian: Array, base: Array, held: float) -> Array:
        """Least squares with a share of the information so far, within the bounds one parameter after the other."""
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

    def _loss(self, left: Array, samples: int, decades: float) -> float:
        """Log-likelihood lost by the remaining errors, with the covariance and colour of the noise refitted."""
        loss, place = 0.0, 0
        for (count, outputs), own in zip(self.view.shapes(samples), self.view.noise_at(decades), strict=True):
            part = left[place : place + count * outputs].reshape(count, outputs)
            place += count * outputs
            if count > 20 * MOST_LAGS:
                loss += _coloured_loss(part, own)
        return loss


def _coloured_loss(left: Array, own: Array) -> float:
    """Log-likelihood lost when errors are added to white noise, of which a noise model explains a part."""
    count, outputs = left.shape
    covariance = autocovariances([np.ascontiguousarray(left)], MOST_LAGS)
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
