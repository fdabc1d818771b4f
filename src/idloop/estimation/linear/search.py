"""Search for the matrices that leave the smallest errors, in coordinates in which the errors change evenly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from idloop.arrays import Array
from idloop.errors import IdloopError
from idloop.estimation.linear.sensitivity import Matrices, compressed_errors, error_moments, score_sums
from idloop.estimation.observer.stationary import riccati
from idloop.estimation.optimisation.levenberg import minimise

_ROUND = 12  # iterations before weights and coordinates are renewed
_TOLERANCE = 1e-4  # decrease of the log-likelihood that is not worth another step
_HIDDEN = 1e-10  # part of the largest change of the errors below which a direction is not shown by the data
_FLOOR = 1e-9  # deviation of an error that counts as none, in deviations of its output
_SAME_WEIGHTS = 1e-2


def autoregressive_covariance(series: Sequence[Array]) -> Array:
    """Covariance of the sum of a stationary series of mean zero, per sample, shape (k, k).

    A vector autoregression whose order minimises the Bayesian criterion is fitted; its spectral density at zero
    frequency is the answer (VARHAC; den Haan and Levin, Handbook of Statistics 15, 1997). The quadratic spectral
    kernel of `idloop.estimation.statistics.covariance` suits scores that die out without swinging.
    """
    k = series[0].shape[1]
    scale = np.sqrt(sum(np.sum(one**2, axis=0) for one in series) / sum(len(one) for one in series))
    scale[scale == 0.0] = 1.0
    samples = sum(len(one) for one in series)
    longest = int(min(samples ** (1 / 3), samples / (10 * k)))
    longest = max(min(longest, min(len(one) for one in series) // 2 - 1), 0)
    windows = np.concatenate(
        [sliding_window_view(one / scale, longest + 1, axis=0).transpose(0, 2, 1) for one in series]
    )
    count = len(windows)
    # Newest lag first: shorter models are the first columns of longer ones.
    columns = windows[:, ::-1].reshape(count, -1)
    factor = np.asarray(np.linalg.qr(np.hstack([columns[:, k:], columns[:, :k]]), mode="r"))
    best, lags = np.inf, 0
    for order in range(longest + 1):
        rest = factor[k * order :, k * longest :]
        sign, size = np.linalg.slogdet(rest.T @ rest / count + 1e-12 * np.eye(k))
        criterion = count * size + np.log(count) * order * k * k
        if sign > 0 and criterion < best:
            best, lags = criterion, order
    coefficients = np.linalg.lstsq(factor[: k * lags, : k * lags], factor[: k * lags, k * longest :], rcond=None)[0]
    rest = factor[k * lags :, k * longest :]
    innovation = rest.T @ rest / count
    back = np.linalg.inv(np.eye(k) - coefficients.reshape(lags, k, k).sum(axis=0).T)
    covariance = back @ innovation @ back.T
    return np.asarray(covariance * np.outer(scale, scale))


@dataclass(frozen=True)
class Parametrisation:
    """How numbers make a model.

    `settle`: parameters to others that describe the same signals and whose predictor is stable, where there are such.
    """

    build: Callable[[Array], Matrices]  # parameters, shape (k,), to the matrices
    slope: Callable[[Array], Array]  # parameters to the derivatives of `Matrices.flat`, shape (entries, k)
    free: Callable[[Array], Array]  # parameters to a basis of the directions in which they are searched, shape (k, f)
    settle: Callable[[Array], Array] = lambda point: point


@dataclass(frozen=True)
class Found:
    """Where the search ended."""

    parameters: Array  # shape (k,)
    covariance: Array  # shape (k, k): of the parameters; NaN where the data do not show one
    free: int  # directions that were searched
    iterations: int
    converged: bool


def search(
    parametrisation: Parametrisation,
    start: Array,
    experiments: Sequence[tuple[Array, Array]],
    *,
    initial: bool,
    white: bool,
    stable: bool,
    max_iterations: int,
) -> Found | None:
    """Minimise the determinant of the errors' covariance by Gauss-Newton steps with damping.

    In each round the errors are weighed with the inverse of their covariance, the parameters are replaced by
    coordinates in which the Jacobian is orthonormal, and Levenberg-Marquardt takes a few steps (data-driven local
    coordinates: McKelvey, Helmersson and Ribarits, Automatica 40, 2004).

    `start` (k,); `initial`: whether the first states are estimated; `white`: whether the errors are taken for white;
    else they are weighed one by one, and the parameters' covariance allows for their colour; `stable`: whether the
    predictor must not forget its first state slower than never: with that state estimated, errors of an unstable
    predictor can be small on the data and are without bound beyond.
    """
    point, iterations, converged = start.copy(), 0, False
    limit = stability_limit(experiments) if stable else np.inf
    start_model = parametrisation.build(point)
    whitener = _whitener(start_model, experiments, initial, white)
    if whitener is None or predictor_radius(start_model) > limit:
        return None
    while True:
        try:
            chart = _Chart(parametrisation, point, experiments, whitener, initial, limit)
        except FloatingPointError:
            return None
        if iterations >= max_iterations or converged:
            break
        origin = np.zeros(chart.basis.shape[1])
        if origin.size == 0:
            converged = True
            break
        wide = np.full(origin.size, np.inf)
        found = minimise(
            chart.residual,
            origin,
            -wide,
            wide,
            np.ones(origin.size),
            max_iterations=min(_ROUND, max_iterations - iterations),
            tolerance=_TOLERANCE,
            derivative=chart.jacobian,
        )
        iterations += found.iterations
        point = parametrisation.settle(chart.point + chart.basis @ found.point)
        renewed = _whitener(parametrisation.build(point), experiments, initial, white)
        assert renewed is not None  # noqa: S101  # a step into overflow is never accepted
        # Weights that hardly change leave the minimum where it is.
        same = np.linalg.norm(renewed @ np.linalg.inv(whitener) - np.eye(len(whitener))) < _SAME_WEIGHTS
        converged = found.converged and bool(same)
        # A search that finds no descent step has ended as well.
        converged = converged or (not np.any(found.point) and bool(same))
        whitener = renewed
    return Found(point, chart.covariance(white), chart.directions, iterations, converged)


def predictor_radius(model: Matrices) -> float:
    """Largest modulus of the eigenvalues of A - K C."""
    closed = model.a - model.gain @ model.c
    if not np.all(np.isfinite(closed)):
        return float("inf")
    return float(np.max(np.abs(np.linalg.eigvals(closed)), initial=0.0))


def mirrored(model: Matrices, covariance: Array) -> Matrices:
    """Same model with the gain of the stable predictor: its unstable eigenvalues are mirrored at the unit circle.

    The spectrum of the outputs stays what it is (spectral factorisation; Anderson and Moore, Optimal Filtering,
    section 9.4), and near the circle so does the gain: a search passes over without a jump.
    """
    if not predictor_radius(model) > 1.0 or not np.all(np.isfinite(model.flat())):
        return model
    closed = model.a - model.gain @ model.c
    # With process noise, however small, the Riccati equation has the stabilising solution.
    size = 1e-14 * float(np.trace(model.gain @ covariance @ model.gain.T)) + 1e-300
    try:
        spread = riccati(closed, model.c, size * np.eye(len(closed)), covariance)
    except (IdloopError, np.linalg.LinAlgError):
        return model
    innovation = model.c @ spread @ model.c.T + covariance
    return replace(model, gain=model.gain + np.linalg.solve(innovation, model.c @ spread @ closed.T).T)


def stability_limit(experiments: Sequence[tuple[Array, Array]]) -> float:
    """Radius by which nothing grows to more than e times its size over the longest experiment.

    Integrators without process noise lie on the unit circle, and rounding puts them on either side.
    """
    return 1.0 + 1.0 / max(len(outputs) for _, outputs in experiments)


class _Chart:
    """Local coordinates around a point: those in which the errors move by one deviation for a unit step."""

    def __init__(
        self,
        parametrisation: Parametrisation,
        point: Array,
        experiments: Sequence[tuple[Array, Array]],
        whitener: Array,
        initial: bool,
        limit: float,
    ) -> None:
        self.parametrisation, self.point, self._limit = parametrisation, point, limit
        self._data = (experiments, whitener, initial)
        free = parametrisation.free(point)
        self.directions = free.shape[1]
        origin, jacobian = self._errors(point, free)
        if not (np.all(np.isfinite(origin)) and np.all(np.isfinite(jacobian))):
            raise FloatingPointError("the errors or their slopes overflow")
        scale = np.linalg.norm(jacobian, axis=0)
        shown = scale > 0.0
        left, values, right = np.linalg.svd(jacobian[:, shown] / scale[shown], full_matrices=False)
        kept = values > _HIDDEN * np.max(values, initial=0.0)
        into = free[:, shown] / scale[shown]
        self.basis = into @ (right[kept].T / values[kept])
        self._last = (np.zeros(self.basis.shape[1]), (origin, left[:, kept]))
        self._hidden = np.hstack([into @ right[~kept].T, free[:, ~shown]])

    def residual(self, move: Array) -> Array:
        """Errors a move away from the point, compressed."""
        return self._linearised(move)[0]

    def jacobian(self, move: Array) -> Array:
        """Their derivatives by the coordinates, in the same rows."""
        return self._linearised(move)[1]

    def _linearised(self, move: Array) -> tuple[Array, Array]:
        # Compression mixes the rows in a way of its own for each move: errors and derivatives come from one pass.
        if not np.array_equal(move, self._last[0]):
            self._last = (move.copy(), self._errors(self.point + self.basis @ move, self.basis))
        return self._last[1]

    def covariance(self, white: bool) -> Array:
        """Covariance of the parameters at the point."""
        if white:
            inner = np.eye(self.basis.shape[1])
        else:
            model = self.parametrisation.build(self.point)
            moves = model.like(self.parametrisation.slope(self.point) @ self.basis)
            scores = score_sums(model, moves, *self._data)
            inner = autoregressive_covariance(scores) * sum(len(part) for part in scores)
        covariance = self.basis @ inner @ self.basis.T
        lost = np.any(np.abs(self._hidden) > 1e-6 * np.max(np.abs(self._hidden), axis=0, initial=1e-300), axis=1)
        covariance[lost] = covariance[:, lost] = np.nan
        return np.asarray(covariance)

    def _errors(self, point: Array, directions: Array) -> tuple[Array, Array]:
        point = self.parametrisation.settle(point)
        model = self.parametrisation.build(point)
        flat = model.flat()
        if not np.all(np.isfinite(flat)) or predictor_radius(model) > self._limit:
            size = directions.shape[1] + 1
            return np.full(size, np.inf), np.full((size, size - 1), np.inf)
        return compressed_errors(model, model.like(self.parametrisation.slope(point) @ directions), *self._data)


def _whitener(model: Matrices, experiments: Sequence[tuple[Array, Array]], initial: bool, white: bool) -> Array | None:
    covariance = error_moments(model, experiments, initial)
    if not np.all(np.isfinite(covariance)):
        return None
    size = np.max([np.std(outputs, axis=0) for _, outputs in experiments], axis=0)
    covariance = covariance + np.diag((_FLOOR * size) ** 2)
    if not white:
        covariance = np.diag(np.diag(covariance))
    return np.linalg.inv(np.linalg.cholesky(covariance))
