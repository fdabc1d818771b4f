"""Maximum-likelihood fit of a model's force balance in weak form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array
from idloop.errors import IdloopError
from idloop.estimation.force_balance.weak_form import BLOCKS, LARGEST_REST, WeakForm
from idloop.estimation.force_balance.weak_likelihood import (
    NormalisedErrors,
    cost_at,
    cost_of,
    force_scales,
    point_limits,
    point_sizes,
    rms_of_columns,
    split_point,
    window_densities,
)
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.optimisation.levenberg import box_step, difference_jacobian, update_jacobian
from idloop.estimation.statistics.student import scale_of
from idloop.physics import Model

Rows = NDArray[np.int64]

# Most sensor noise in the unexplained force of wide enough windows [ratio of standard deviations].
MOST_NOISE = 0.3
# Factor by which windows become wider.
_WIDER = 1.4
# Model error dominates a balance with at most this part of sensor noise, and at least that part of the drive's force.
_LITTLE_NOISE, LEAST_UNEXPLAINED = 0.1, 0.01
# Noise of a measured command accounts for the unexplained force where it is this part of that.
_ALL_NOISE = 0.9
# A model that leaves this part of the drive's force unexplained has not found the force that moves the axis.
_NOT_FOUND = 0.9
# Relative difference of two sensors' velocities of one body above which they disagree.
_DISAGREE = 0.02
# Least share of the acceleration's power without noise, as the inertia is biased by the rest.
LEAST_RELIABLE = 0.8
# A fit to prediction errors with so many times the unexplained force of a disturbance takes a force for a disturbance,
# in windows of at most so many times the widest that resolve the motion.
_HIDDEN, _PERIOD = 1.5, 4
# Part of the power of a measured command from which on its noise biases predictions.
_NOISY_COMMAND = 0.01
# Least number of windows for a comparison of models.
FEWEST_ROWS = 100
# Predicted gain of log-likelihood at which a search ends, and for one that only ranks models.
TOLERANCE, RANKING_TOLERANCE = 1e-4, 0.3
MOST_ITERATIONS, _MOST_DAMPING = 60, 1e8
# A Jacobian is updated as long as a step gains this part of what it predicts.
_AS_PREDICTED = 0.5
# First difference step as a part of a parameter's size; the next ones as a part of its standard error, far above the
# corners of friction at single samples.
_SLOPE_STEP, _STEP_OF_ERROR = 1e-4, 0.3
# Least damping of a step after one that gained nothing.
_LEAST_DAMPING = 0.1
# Most iterations, and tolerance, of a fit to some windows with the slopes of that to all. By the windows left out
# the optimum moves by about a sixth of a unit of log-likelihood for each parameter.
_FOLD_ROUNDS, _FOLD_TOLERANCE = 10, 0.05
# Factor of the search for the rest speed, and the gain of log-likelihood that a step must bring.
_REST_STEP, _WORTH_A_REST = 3.0, 5.0
# A search begins on so many windows, where there are at least so many times as many.
_DRAFT, _WORTH_A_DRAFT = 2000, 4


@dataclass(frozen=True)
class WeakFit:
    """Parameters fitted by the force balance."""

    form: WeakForm
    # shape (k,) or (k + 1,): free parameters, then the time from the stamp of a command to its action [s] where that is
    # free
    point: Array
    scale: Array  # shape (bodies,): of Student's t distribution of the unexplained force
    rows: Rows  # fitted windows
    log_likelihood: float  # of these windows
    iterations: int
    converged: bool
    jacobian: Array  # shape (rows bodies, k): of the normalised errors at the end of the search

    @property
    def theta(self) -> Array:
        """Values of the free parameters."""
        return self.point[: len(self.form.engine.free)]

    @property
    def model(self) -> Model:
        """The fitted model."""
        return self.form.engine.model.with_theta(self.theta)

    @property
    def shift(self) -> float:
        """Time from the stamp of a command to its action [s]."""
        return float(self.point[-1]) if self.form.free_timing else 0.0

    @cached_property
    def residual(self) -> Array:
        """Unexplained force in every window, shape (rows, bodies)."""
        return self.form.residual(self.theta, self.shift)

    @cached_property
    def relative_by_body(self) -> Array:
        """As of `relative_errors`, for the fitted records."""
        return relative_errors(self.form, self.theta, self.shift)

    @property
    def relative(self) -> float:
        """Rms of the unexplained force over that of the drive's force, in all windows."""
        return float(self.relative_by_body[0])

    @cached_property
    def model_error_dominates(self) -> bool:
        """Whether model error, not sensor noise, limits the balance."""
        return self.resolved and model_error_dominates(self.form, self.theta, self.shift)

    @property
    def usable(self) -> bool:
        """Whether the unexplained force may show a missing effect: it is reliable and not negligible."""
        return self.reliable and float(np.max(self.relative_by_body)) >= LEAST_UNEXPLAINED

    @property
    def explains_force(self) -> bool:
        """Whether the model has found a force that moves the axis."""
        return self.relative < _NOT_FOUND

    @property
    def noisy_command(self) -> bool:
        """Whether noise of a measured command biases predictions, and not the balance, whose error it is.

        By its part of the command's power least squares underestimate all forces (Fuller, *Measurement Error Models*,
        1987).
        """
        noise = sum(len(data.input) * data.command_noise**2 for data in self.form.data)
        return noise > _NOISY_COMMAND * sum(float(data.input @ data.input) for data in self.form.data)

    @property
    def scaled_by_loop(self) -> bool:
        """Whether an unknown gain of a loop in the drive scales the forces, so that the balance must not decide.

        With the gain and a delay of the set-point grows the part of the force that they explain, and the inertia is
        lost beside it; predictions and a free run, which the loop holds, tell them apart.
        """
        return self.form.engine.model.loop_scale_is_free

    def contradicts(self, predicted: Model) -> bool:
        """Whether the same model, fitted to prediction errors, takes a force for a disturbance.

        The balance explains that force; or noise of the command biases predictions.
        """
        if self.scaled_by_loop:
            return False
        if self.usable and self.noisy_command:
            return True
        if not self.usable or self.relative >= 1.0 or self.form.width > _PERIOD * self.form.widest:
            return False
        # Least squares count a part of a disturbance as inertia, and leave less of it unexplained.
        disturbed = self.relative / np.sqrt(1.0 - self.relative**2)
        try:
            left = relative_errors(self.form.with_engine(CachingEngine(predicted)), predicted.theta, self.shift)[0]
        except IdloopError:
            return True
        return not left <= _HIDDEN * disturbed

    @property
    def resolved(self) -> bool:
        """Whether sensor noise is a small part of the unexplained force of some body."""
        return bool(np.any(self.noise_share <= MOST_NOISE))

    @property
    def reliable(self) -> bool:
        """Whether sensors agree, and neither acceleration nor unexplained force are mostly noise."""
        return self.resolved and _motion_reliable(self.form, self.theta, self.shift)

    @property
    def noise_share(self) -> Array:
        """Sensor noise in the unexplained force by body, shape (bodies,); at most 1."""
        inertia = self.form.inertia(self.theta)
        return np.minimum(inertia * self.form.noise / self.scale, 1.0)

    def log_densities(self, form: WeakForm | None = None) -> Array:
        """Log-density of every window, of these records or others, with the fitted values and scale, shape (rows,)."""
        return window_densities(self.form if form is None else form, self.point, self.scale)

    def along(self, form: WeakForm) -> WeakFit:
        """The same values, without a fit, in other windows."""
        residual = form.residual(*split_point(form, self.point))
        scale, rows = force_scales(form, self.point, residual), np.arange(form.starts[-1])
        likelihood = -cost_of(NormalisedErrors(form)(self.point))
        return WeakFit(form, self.point, scale, rows, likelihood, self.iterations, self.converged, np.zeros((0, 0)))

    def subsampled(self, most: int) -> WeakFit:
        """The fit to about so many of the windows, spread evenly; itself where there are fewer."""
        form = self.form.subsampled(most)
        return self if form is self.form else fit_weak(form, self.point)

    @cached_property
    def errors(self) -> Array:
        """Normalised errors of all windows, shape (rows, bodies)."""
        return NormalisedErrors(self.form)(self.point)

    @cached_property
    def linear(self) -> tuple[Array, Array]:
        """Standardised errors of all windows (rows, bodies), and their derivatives (rows, bodies, k)."""
        error = self.errors
        scale = rms_of_columns(error)
        return error / scale, self.jacobian.reshape(*error.shape, -1) / scale[:, None]

    @property
    def slopes(self) -> Array:
        """Jacobian of the standardised errors, shape (rows bodies, k)."""
        return self.linear[1].reshape(-1, len(self.point))

    @cached_property
    def slopes_of_force(self) -> Array:
        """Jacobian of the driven body's unexplained force, shape (rows, k)."""
        (_, upper), sizes = point_limits(self.form), point_sizes(self.form, self.point)
        found = np.zeros((len(self.residual), len(self.point)))
        for place, step in enumerate(_SLOPE_STEP * sizes):
            there = self.point.copy()
            there[place] += step if there[place] + step <= upper[place] else -step
            moved = self.form.residual(*split_point(self.form, there))[:, 0]
            found[:, place] = (moved - self.residual[:, 0]) / (there[place] - self.point[place])
        return np.where(np.all(np.isfinite(found), axis=0), found, 0.0)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the point, from independent segments; NaN for parameters without influence, or no fit."""
        if not self.jacobian.size:
            return np.full((len(self.point), len(self.point)), np.nan)
        base, slopes = (part[self.rows] for part in self.linear)
        size = np.sqrt(np.sum(slopes**2, axis=(0, 1)))
        dead = size <= 1e-12 * np.max(size, initial=0.0)
        if self.form.free_timing:
            # At a limit the timing does not give way to the other parameters.
            lower, upper = point_limits(self.form)
            dead[-1] |= not lower[-1] < self.point[-1] < upper[-1]
            slopes = slopes * np.where(dead, 0.0, 1.0)
        size = np.where(dead, 1.0, size)
        scaled = slopes / size
        flat = scaled.reshape(slopes.shape[0] * slopes.shape[1], len(size))
        bread = np.linalg.pinv(flat.T @ flat, rcond=1e-12, hermitian=True)
        scores = np.sum(base[:, :, None] * scaled, axis=1)
        sums = np.array([block.sum(axis=0) for block in np.array_split(scores, BLOCKS)])
        covariance = bread @ (sums.T @ sums) @ bread * BLOCKS / (BLOCKS - 1.0) / np.outer(size, size)
        covariance[dead, :] = covariance[:, dead] = np.nan
        return np.asarray(covariance)

    def refitted(self, rows: Rows) -> WeakFit:
        """The fit to some of the windows, with the slopes of this one."""
        return fit_weak(
            self.form, self.point, rounds=_FOLD_ROUNDS, tolerance=_FOLD_TOLERANCE, rows=rows,
            slopes=self.jacobian, error=self.errors,
        )  # fmt: skip


def relative_errors(form: WeakForm, theta: Array, shift: float) -> Array:
    """Rms of the unexplained force of every body over that of the acting force (of the drive), shape (bodies,).

    `theta`, `shift`: as of `WeakForm.residual`.
    """
    left, acting = _left_and_acting(form, theta, shift)
    return np.asarray(np.linalg.norm(left, axis=0) / acting)


def typical_errors(form: WeakForm, theta: Array, shift: float) -> Array:
    """As `relative_errors`, by the scale of Student's t distribution in place of the rms: outliers count little."""
    left, acting = _left_and_acting(form, theta, shift)
    return np.asarray(typical_sizes_of(left) * np.sqrt(len(left)) / acting)


def typical_sizes_of(left: Array) -> Array:
    """Scale of Student's t distribution of the unexplained force (rows, bodies) of every body, shape (bodies,)."""
    return np.array([scale_of(column) for column in left.T])


def _left_and_acting(form: WeakForm, theta: Array, shift: float) -> tuple[Array, Array]:
    """Unexplained force, shape (rows, bodies), and the norm of the acting force, shape (bodies,), positive."""
    left = form.residual(theta, shift)
    acting = form.inertia(theta) * form.inertial - left
    acting[:, 0] = form.drive(theta, shift)
    return left, np.maximum(np.linalg.norm(acting, axis=0), 1e-300)


def model_error_dominates(form: WeakForm, theta: Array, shift: float) -> bool:
    """Whether model error, not noise of sensors or command, limits a balance in windows that resolve the motion."""
    if not _motion_reliable(form, theta, shift):
        return False
    inertia = form.inertia(theta)
    wide: WeakForm | None = form
    while wide is not None and wide.width <= form.widest:
        left = np.sqrt(np.mean(wide.residual(theta, shift) ** 2, axis=0))
        if wide.gain(theta) * wide.command_noise >= _ALL_NOISE * left[0]:
            return False
        if np.all(inertia * wide.noise <= _LITTLE_NOISE * left):
            return float(np.max(relative_errors(wide, theta, shift))) >= LEAST_UNEXPLAINED
        wide = wide.in_windows(wider_than(wide.width))
    return False


def _motion_reliable(form: WeakForm, theta: Array, shift: float) -> bool:
    """Whether sensors agree on the motion, and the acceleration is not mostly noise."""
    return form.reliability >= LEAST_RELIABLE and _sensors_agree(form, theta, shift)


def _sensors_agree(form: WeakForm, theta: Array, shift: float) -> bool:
    """Whether two sensors of a body agree, or what they disagree on is little beside the unexplained force.

    Jitter of the stamps and pulses that are missed average out over wider windows, where a missing force stays. What
    the sensors lack, such as a filter of one of them, makes unexplained force and disagreement of one size.
    """
    if form.disagreement <= _DISAGREE:
        return True
    inertia = form.inertia(theta)
    wide: WeakForm | None = form
    while wide is not None and wide.starts[-1] >= FEWEST_ROWS:
        left = np.sqrt(np.mean(wide.residual(theta, shift) ** 2, axis=0))
        if np.all(inertia * wide.acceleration_disagreement <= MOST_NOISE * left):
            return True
        wide = wide.in_windows(wider_than(wide.width))
    return False


def fit_weak(
    form: WeakForm,
    start: Array,
    *,
    rounds: int = MOST_ITERATIONS,
    tolerance: float = TOLERANCE,
    equal_shares: bool = False,
    rows: Rows | None = None,
    slopes: Array | None = None,
    error: Array | None = None,
) -> WeakFit:
    """Fit a model to a force balance.

    `start` (k,) or (k + 1,): free parameters, and the command delay where that is free (0 when left out).
    `rounds`: most iterations.
    `tolerance`: predicted gain of log-likelihood at which the search ends.
    `equal_shares`: count every window by its command: not the likelihood, but a start for a search.
    `rows`: fit to these windows only; all when left out.
    `slopes` (all rows bodies, k): Jacobian of the normalised errors at the start, which saves its computation: it is
    updated by Broyden's formula (Math. Comp. 19, 1965).
    `error` (all rows, bodies): normalised errors at the start, which saves their computation.
    Raises IdloopError: the balance cannot be evaluated at the start.
    """
    lower, upper = point_limits(form)
    point = np.clip(start if len(start) == len(lower) else np.append(start, 0.0), lower, upper)
    size = point_sizes(form, point)
    step = _SLOPE_STEP * size
    if error is None and not np.all(np.isfinite(form.residual(*split_point(form, point)))):
        raise IdloopError("the force balance cannot be evaluated at the starting values")
    whole = NormalisedErrors(form, equal_shares=equal_shares)
    fitted = np.arange(form.starts[-1]) if rows is None else rows

    def target(at: Array) -> Array:
        found = whole(at)
        return found if rows is None else found[rows]

    jacobian, updates = np.zeros((0, len(point))), 0
    if slopes is not None:
        jacobian = slopes.reshape(form.starts[-1], -1, len(point))[fitted].reshape(-1, len(point))
    computed = slopes is not None
    damping, converged, iteration = 1e-3, False, 0
    error = target(point) if error is None else error[fitted]
    cost = cost_of(error)
    while iteration < rounds and not converged:
        iteration += 1
        scale = np.tile(rms_of_columns(error), len(error))
        base = error.ravel() / scale
        if not computed:

            def scaled(at: Array, scale: Array = scale) -> Array:
                return target(at).ravel() / scale

            jacobian, step = difference_jacobian(scaled, point, base, lower, upper, step, size, central=False)
            jacobian[:, ~np.all(np.isfinite(jacobian), axis=0)] = 0.0
            change = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
            step = np.clip(_STEP_OF_ERROR / change, 1e-6 * size, 1e-2 * size)
            jacobian *= scale[:, None]
            computed, updates = True, 0
        # The Jacobian of a search of its own is computed again before anything is concluded from an updated one.
        certain = updates == 0 or slopes is not None
        found = jacobian / scale[:, None]
        gradient, hessian = found.T @ base, found.T @ found
        while True:
            move, predicted = box_step(gradient, hessian, damping, point, lower, upper)
            if predicted <= tolerance or damping > _MOST_DAMPING:
                computed, converged = certain, certain
                break
            trial = np.clip(point + move, lower, upper)
            left = target(trial)
            gained = cost - cost_of(left) if np.all(np.isfinite(left)) else -np.inf
            if gained > 0.0:
                update_jacobian(jacobian, trial - point, (left - error).ravel(), hessian)
                point, error, cost, updates = trial, left, cost - gained, updates + 1
                damping = max(0.1 * damping, 1e-9)
                converged = certain and gained < tolerance
                computed = slopes is not None or gained >= _AS_PREDICTED * predicted
                break
            if not certain:
                computed = False
                break
            damping = max(8.0 * damping, _LEAST_DAMPING)
        size = np.maximum(size, np.abs(point))
    scales = force_scales(form, point, form.residual(*split_point(form, point)), fitted)
    return WeakFit(form, point, scales, fitted, -cost, iteration, converged, jacobian)


def with_rest_speed(fit: WeakFit, tolerance: float = TOLERANCE) -> WeakFit:
    """The fit with the rest speed raised as long as that is likelier; the tolerance is that of `fit_weak`."""
    while (likelier := likelier_rest_speed(fit.form, fit.point)) is not None:
        fit = fit_weak(likelier, fit.point, tolerance=tolerance)
    return fit


def likelier_rest_speed(form: WeakForm, point: Array) -> WeakForm | None:
    """The same windows with a larger rest speed, where that is much likelier at a point.

    None where it is not, or without a dry friction in the model.
    """
    if not any(active.effect.friction is not None for active in form.engine.model.effects):
        return None
    faster = form.with_rest_speed(min(_REST_STEP * form.rest_speed, LARGEST_REST * form.typical_speed))
    if faster.rest_speed <= form.rest_speed:
        return None
    return faster if cost_at(faster, point) < cost_at(form, point) - _WORTH_A_REST else None


def draft_windows(form: WeakForm) -> WeakForm:
    """The windows on which a search begins: a part of them where that saves much."""
    return form.subsampled(_DRAFT) if form.starts[-1] >= _WORTH_A_DRAFT * _DRAFT else form


def fit_from_two_starts(form: WeakForm, start: Array) -> WeakFit:
    """The likelier of two fits as of `fit_weak`: from the start, and from the fit with equal shares."""
    draft = draft_windows(form)
    equal = fit_weak(draft, start, equal_shares=True)
    found = max(fit_weak(draft, start), fit_weak(draft, equal.point), key=lambda fit: fit.log_likelihood)
    return found if draft is form else fit_weak(form, found.point)


def wider_than(width: int) -> int:
    """Samples in the next wider windows."""
    return max(round(_WIDER * width), width + 1)
