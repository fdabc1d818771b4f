"""Maximum-likelihood fit of a model's force balance in weak form.

The likelihood is that of the recorded command, given the motion, and of the acceleration of bodies without a drive. Its
density is Student's t of the unexplained force, times the derivative of the balance by the command (or the inertia):
scaling all forces down, or switching the command off, gains nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import log

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array, Mask
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data
from idloop.estimation.force_balance.weak_form import BLOCKS, LARGEST_REST, NARROWEST, WeakForm, WindowShares, weak_form
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.optimisation.levenberg import box_step, difference_jacobian, update_jacobian
from idloop.estimation.optimisation.solve import typical_size
from idloop.estimation.statistics.student import log_density, scale_of
from idloop.physics import Engine, Model
from idloop.physics.effect import INPUT

Rows = NDArray[np.int64]

# Limits of the time from the stamp of a command to its action, in samples; a larger delay is an effect of the model.
_EARLIEST, _LATEST = -1.0, 1.5
# Most sensor noise in the unexplained force of wide enough windows [ratio of standard deviations].
MOST_NOISE = 0.3
_WIDER = 1.4
# Model error dominates a balance with at most this part of sensor noise, and at least that part of the drive's force.
_LITTLE_NOISE, LEAST_UNEXPLAINED = 0.1, 0.01
# Noise of a measured command accounts for the unexplained force where it is this part of that.
_ALL_NOISE = 0.9
# A model that leaves this part of the drive's force unexplained has not found the force that moves the axis.
_NOT_FOUND = 0.9
# Relative difference of two sensors' velocities of one body above which they disagree.
_DISAGREE = 0.02
# Narrow windows agree with those wider by these ratios where they show at least that part of the inertia, or where
# their values lose at most this log-likelihood there. Noise with a memory averages out slowly: the first shows little.
_FAR_WIDER, _SAME_INERTIA, _AS_LIKELY = (2.5, 6.25), 0.95, 3.0
# Noise hides an inertia from narrow windows where wide ones show it with so many times the log-likelihood.
_FAR_BETTER = 2.0
# Least share of the acceleration's power without noise, as the inertia is biased by the rest.
_RELIABLE = 0.8
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
# Name of the time from the stamp of a command to its action beside those of the free parameters.
_TIMING = "timing"
# Most iterations, and tolerance, of a fit to some windows with the slopes of that to all. By the windows left out
# the optimum moves by about a sixth of a unit of log-likelihood for each parameter.
_FOLD_ROUNDS, _FOLD_TOLERANCE = 10, 0.05
# A window counts fully by its command where the balance depends on that by at least this part of the gain.
_FULL_RESPONSE = 0.5
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

    def contradicts(self, predicted: Model) -> bool:
        """Whether the same model, fitted to prediction errors, takes a force for a disturbance.

        The balance explains that force; or noise of the command biases predictions.
        """
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
        return _log_densities(self.form if form is None else form, self.point, self.scale)

    def along(self, form: WeakForm) -> WeakFit:
        """The same values, without a fit, in other windows."""
        residual = form.residual(*_split(form, self.point))
        scale, rows = _scales(form, self.point, residual), np.arange(form.starts[-1])
        likelihood = -_cost(_Target(form)(self.point))
        return WeakFit(form, self.point, scale, rows, likelihood, self.iterations, self.converged, np.zeros((0, 0)))

    def subsampled(self, most: int) -> WeakFit:
        """The fit to about so many of the windows, spread evenly; itself where there are fewer."""
        form = self.form.subsampled(most)
        return self if form is self.form else fit_weak(form, self.point)

    @cached_property
    def errors(self) -> Array:
        """Normalised errors of all windows, shape (rows, bodies)."""
        return _Target(self.form)(self.point)

    @cached_property
    def linear(self) -> tuple[Array, Array]:
        """Standardised errors of all windows (rows, bodies), and their derivatives (rows, bodies, k)."""
        error = self.errors
        scale = _rms(error)
        return error / scale, self.jacobian.reshape(*error.shape, -1) / scale[:, None]

    @property
    def slopes(self) -> Array:
        """Jacobian of the standardised errors, shape (rows bodies, k)."""
        return self.linear[1].reshape(-1, len(self.point))

    @cached_property
    def slopes_of_force(self) -> Array:
        """Jacobian of the driven body's unexplained force, shape (rows, k)."""
        (_, upper), sizes = _limits(self.form), _sizes(self.form, self.point)
        found = np.zeros((len(self.residual), len(self.point)))
        for place, step in enumerate(_SLOPE_STEP * sizes):
            there = self.point.copy()
            there[place] += step if there[place] + step <= upper[place] else -step
            moved = self.form.residual(*_split(self.form, there))[:, 0]
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
    left = form.residual(theta, shift)
    acting = form.inertia(theta) * form.inertial - left
    acting[:, 0] = form.drive(theta, shift)
    return np.asarray(np.linalg.norm(left, axis=0) / np.maximum(np.linalg.norm(acting, axis=0), 1e-300))


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
        wide = wide.in_windows(_wider(wide.width))
    return False


def _motion_reliable(form: WeakForm, theta: Array, shift: float) -> bool:
    """Whether sensors agree on the motion, and the acceleration is not mostly noise."""
    return form.reliability >= _RELIABLE and _sensors_agree(form, theta, shift)


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
        wide = wide.in_windows(_wider(wide.width))
    return False


def _limits(form: WeakForm) -> tuple[Array, Array]:
    lower, upper = form.engine.model.bounds
    if not form.free_timing:
        return lower, upper
    step = form.sample_time
    return np.append(lower, _EARLIEST * step), np.append(upper, _LATEST * step)


def _sizes(form: WeakForm, point: Array) -> Array:
    lower, upper = form.engine.model.bounds
    size = typical_size(point[: len(lower)], lower, upper)
    return np.append(size, form.sample_time) if form.free_timing else size


def _split(form: WeakForm, point: Array) -> tuple[Array, float]:
    return (point[:-1], float(point[-1])) if form.free_timing else (point, 0.0)


def _shares(form: WeakForm, point: Array) -> WindowShares:
    """By what every window counts.

    An effect at the input is measured over all windows: on a command of two levels a gain asymmetry equals an offset. A
    friction that absorbs a part of the drive's force is measured window by window.
    """
    known = form.shares.get(key := point.tobytes())
    if known is not None:
        return known
    theta, shift = _split(form, point)
    slope = form.slope(theta, shift)
    least = _FULL_RESPONSE * form.gain(theta)
    overall, each = form.drives(theta, shift, least)
    passed = np.where(each > 0.0, slope / np.maximum(each, 1e-300), 1.0)
    cut_off = (1.0 - np.minimum(each / least, 1.0)) * (1.0 - form.standing)
    command = np.minimum(np.minimum(slope / least, 1.0), 1.0 - cut_off)
    found = WindowShares(command, 1.0 - command - cut_off, np.log(overall * np.maximum(passed, 1e-300)))
    form.shares.clear()
    form.shares[key] = found
    return found


def _errors(form: WeakForm, theta: Array, residual: Array, standing: Array) -> Array:
    """Unexplained force on the driven body in every window; its inertial force where friction holds it."""
    return np.asarray(residual[:, 0] + standing * form.inertia(theta)[0] * form.inertial[:, 0])


def _strength_of_motion(form: WeakForm, theta: Array) -> Array:
    """Log of the force per input for windows that count by their motion, shape (rows,)."""
    return np.asarray(log(max(form.inertia(theta)[0], 1e-300)) - form.motion_per_input)


def _log_densities(form: WeakForm, point: Array, scale: Array) -> Array:
    theta, shift = _split(form, point)
    residual = form.residual(theta, shift)
    shares = _shares(form, point)
    total = log_density(_errors(form, theta, residual, shares.standing), float(scale[0]))
    total = total + shares.command * shares.strength + (1.0 - shares.command) * _strength_of_motion(form, theta)
    inertia = form.inertia(theta)
    for body in range(1, residual.shape[1]):
        total = total + log_density(residual[:, body], float(scale[body])) + np.log(inertia[body])
    return np.asarray(total)


def _scales(form: WeakForm, point: Array, residual: Array, rows: Rows | slice = slice(None)) -> Array:
    """Scale of every body's unexplained force, shape (bodies,)."""
    shares = _shares(form, point)
    errors = _errors(form, _split(form, point)[0], residual, shares.standing)
    scale = scale_of(errors[rows], float(np.sum(1.0 - shares.standing[rows])))
    return np.array([scale, *(scale_of(column) for column in residual[rows, 1:].T)])


class _Target:
    """Normalised errors, shape (rows, bodies): minus the log-likelihood is the sum of n times the log of their rms.

    The window shares are computed only when a parameter that changes them moves. With equal shares the errors are the
    unexplained force over the gain, which has a single optimum in parameters that the force is linear in.
    """

    def __init__(self, form: WeakForm, *, equal_shares: bool = False) -> None:
        self.form = form
        self._equal_shares = equal_shares
        names = (*form.engine.free, _TIMING) if form.free_timing else form.engine.free
        self._moves = np.array([_moves_slope(form.engine.model, name) for name in names], dtype=bool)
        self._known: tuple[bytes, _Counts] | None = None

    def __call__(self, point: Array) -> Array:
        theta, shift = _split(self.form, point)
        residual, rows = self.form.residual(theta, shift), self.form.starts[-1]
        key = point[self._moves].tobytes()
        if self._known is None or self._known[0] != key:
            self._known = key, self._counts(point, residual)
        counts = self._known[1]
        constant, first = counts.constant, residual[:, 0]
        if np.any(counts.silent > 0.0):
            constant -= float(np.sum(counts.silent * _strength_of_motion(self.form, theta)))
            first = _errors(self.form, theta, residual, counts.standing)
        error = residual / self.form.inertia(theta)
        error[:, 0] = first * np.sqrt(rows / counts.moving) * np.exp(constant / rows)
        return np.asarray(error)

    def _counts(self, point: Array, residual: Array) -> _Counts:
        rows = len(residual)
        if self._equal_shares:
            strength = log(self.form.gain(_split(self.form, point)[0]))
            return _Counts(np.zeros(rows), float(rows), np.zeros(rows), -rows * strength)
        shares = _shares(self.form, point)
        held = float(np.sum(shares.standing))
        # A body at rest adds no error to the rms, to which every other window contributes half a unit.
        constant = -float(np.sum(shares.command * shares.strength)) - 0.5 * held
        return _Counts(shares.standing, max(rows - held, 1e-9), 1.0 - shares.command, constant)


@dataclass(frozen=True)
class _Counts:
    """Sums of the window shares for a target."""

    standing: Array  # shape (rows,)
    moving: float  # number of windows in the scale
    silent: Array  # shape (rows,): share of the motion
    constant: float  # part of minus the log-likelihood that no other parameter changes


def _moves_slope(model: Model, name: str) -> bool:
    """Whether a parameter changes the response of the driven body's balance to the command.

    Every one does where a dry friction holds that body against the sum of the other forces.
    """
    if any(active.effect.friction is not None and active.at == model.bodies[0] for active in model.effects):
        return True
    owner = name.rpartition(".")[0]
    at_input = [active.name for active in model.effects if active.effect.site == INPUT]
    return owner in ("drive", *at_input) or (name == _TIMING and bool(at_input))


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
    lower, upper = _limits(form)
    point = np.clip(start if len(start) == len(lower) else np.append(start, 0.0), lower, upper)
    size = _sizes(form, point)
    step = _SLOPE_STEP * size
    if error is None and not np.all(np.isfinite(form.residual(*_split(form, point)))):
        raise IdloopError("the force balance cannot be evaluated at the starting values")
    whole = _Target(form, equal_shares=equal_shares)
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
    cost = _cost(error)
    while iteration < rounds and not converged:
        iteration += 1
        scale = np.tile(_rms(error), len(error))
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
            gained = cost - _cost(left) if np.all(np.isfinite(left)) else -np.inf
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
    scales = _scales(form, point, form.residual(*_split(form, point)), fitted)
    return WeakFit(form, point, scales, fitted, -cost, iteration, converged, jacobian)


def _rms(error: Array) -> Array:
    """Root mean square of every column, never 0."""
    return np.asarray(np.maximum(np.sqrt(np.mean(error**2, axis=0)), 1e-300))


def cost_at(form: WeakForm, start: Array) -> float:
    """Minus the log-likelihood at a start of a fit; infinite where the balance cannot be evaluated."""
    lower, upper = _limits(form)
    point = np.clip(start if len(start) == len(lower) else np.append(start, 0.0), lower, upper)
    error = _Target(form)(point)
    return _cost(error) if np.all(np.isfinite(error)) else np.inf


def _cost(error: Array) -> float:
    """Minus the log-likelihood of normalised errors at their best scale, without a constant."""
    return float(len(error) * np.sum(np.log(_rms(error))))


def fit_by_force(
    engine: Engine,
    data: Sequence[Data],
    start: Array,
    known: dict[int, WeakForm] | None = None,
    *,
    accept_noise: bool = False,
    rest_speed: float | None = None,
    narrowest: int = NARROWEST,
) -> WeakFit | None:
    """Fit a model to records by its force balance, in the narrowest windows that sensor noise does not dominate.

    This must hold for every body, else for some body. Where noise is much of the acceleration the inertia is biased
    down, and with it the noise in units of force: far wider windows must not show a larger inertia.

    `start` (k,).
    `known`: cache of windows of these data by width, for other models.
    `accept_noise`: use the widest windows where sensor noise dominates in all.
    `rest_speed`: first rest speed of the search [m/s or rad/s].
    `narrowest`: samples in the first windows.
    Returns: None where some body is not measured, or sensor noise dominates at any width.
    Raises IdloopError: the balance cannot be evaluated at the start.
    """
    width, point = narrowest, start
    forms = {} if known is None else known
    found: WeakFit | None = None
    # For a body without model error only noise is unexplained, at any width.
    partly_resolved: WeakFit | None = None
    noisy, skipped = False, None
    while True:
        form = _windows(engine, data, width, forms)
        if form is None:
            if partly_resolved is None and accept_noise and skipped is not None:
                return with_rest_speed(fit_weak(skipped, point))
            return partly_resolved or (found if accept_noise else None)
        form = form if rest_speed is None else form.with_rest_speed(rest_speed)
        noisy = noisy or form.reliability < _RELIABLE
        if found is not None and _mostly_noise(form, found.point):
            skipped, width = form, _wider(width)
            continue
        skipped = None
        found = with_rest_speed(fit_from_two_starts(form, point) if width == narrowest else fit_weak(form, point))
        # No body is without inertia: where a fit finds none, noise has hidden it.
        free = found.form.engine.free
        noisy = noisy or any(name.endswith(".inertia") for name, at in zip(free, _at_limit(found), strict=True) if at)
        if form.reliability >= _RELIABLE and found.resolved:
            attenuated = _underestimates_inertia(found, start, forms, noisy=noisy)
            noisy = noisy if attenuated is None else attenuated or _noise_hides_inertia(found, forms)
            if not noisy and np.all(found.noise_share <= MOST_NOISE):
                return found
            partly_resolved = partly_resolved or (None if noisy else found)
        width, point = _wider(width), _off_limits(found, start)


def _off_limits(fit: WeakFit, start: Array) -> Array:
    """Values of a fit, and those of the start where they are at a limit: a search there may see no way back."""
    return np.where(_at_limit(fit), start[: len(fit.theta)], fit.theta)


def _at_limit(fit: WeakFit) -> Mask:
    """Which free parameters are at a limit, shape (k,)."""
    lower, upper = fit.form.engine.model.bounds
    return np.asarray((fit.theta <= lower) | (fit.theta >= upper))


def _mostly_noise(form: WeakForm, point: Array) -> bool:
    """Whether noise dominates whatever is fitted: it does in what these values leave, and a fit leaves less."""
    if form.reliability < _RELIABLE:
        return True
    theta, shift = _split(form, point)
    left = _scales(form, point, form.residual(theta, shift))
    return bool(np.all(form.inertia(theta) * form.noise > MOST_NOISE * left))


def _windows(engine: Engine, data: Sequence[Data], width: int, known: dict[int, WeakForm]) -> WeakForm | None:
    """Windows of a width, of those known where possible; None where there are too few of them."""
    if width in known:
        form: WeakForm | None = known[width].with_engine(engine)
    elif known:
        form = next(iter(known.values())).with_engine(engine).in_windows(width)
    else:
        form = weak_form(engine, data, width)
    if form is None or form.starts[-1] < FEWEST_ROWS:
        return None
    known.setdefault(width, form)
    return form


def _underestimates_inertia(fit: WeakFit, start: Array, forms: dict[int, WeakForm], *, noisy: bool) -> bool | None:
    """Whether far wider windows, in which noise averages out, show a larger inertia, with which they leave less force.

    None where there are too few of them. Noise of unknown colour, as of a jitter of the stamps, is underestimated, and
    with it how much it attenuates. Where it was much of the acceleration in narrower windows (`noisy`), the values must
    be as likely as the others; else they must not leave much more.
    """
    found: bool | None = None
    for ratio in _FAR_WIDER:
        shown = _shows_more_inertia(fit, start, forms, ratio, noisy=noisy)
        if shown:
            return True
        found = found if shown is None else shown
    return found


def _shows_more_inertia(
    fit: WeakFit, start: Array, forms: dict[int, WeakForm], ratio: float, *, noisy: bool
) -> bool | None:
    """As `_underestimates_inertia`, in windows that are wider by one ratio."""
    form = _windows(fit.form.engine, fit.form.data, round(ratio * fit.form.width), forms)
    if form is None:
        return None
    draft = draft_windows(form.with_rest_speed(fit.form.rest_speed))
    wider = fit_weak(draft, _off_limits(fit, start), tolerance=RANKING_TOLERANCE)
    narrow, wide = (one.form.inertia(one.theta) / one.form.gain(one.theta) for one in (fit, wider))
    if np.all(narrow >= _SAME_INERTIA * wide):
        return False
    lost = cost_at(wider.form, fit.point) + wider.log_likelihood
    return lost > (_AS_LIKELY if noisy else -log(_RELIABLE) * wider.form.starts[-1])


def _noise_hides_inertia(fit: WeakFit, forms: dict[int, WeakForm]) -> bool:
    """Whether far wider windows show an inertia beside forces that the model lacks, where these show hardly any.

    Where a force that is missing makes an inertia, as dry friction of a slow motion does, all windows show it alike.
    """
    bodies = range(len(fit.scale))
    narrow = [_inertia_beside_all(fit.form, fit, body) for body in bodies]
    for ratio in _FAR_WIDER:
        form = _windows(fit.form.engine, fit.form.data, round(ratio * fit.form.width), forms)
        if form is None:
            continue
        for (least, known), body in zip(narrow, bodies, strict=True):
            inertia, shown = _inertia_beside_all(form, fit, body)
            if shown > _FAR_BETTER * known + _AS_LIKELY and inertia > max(least / _SAME_INERTIA, 0.0):
                return True
    return False


def _inertia_beside_all(form: WeakForm, fit: WeakFit, body: int) -> tuple[float, float]:
    """The inertia that windows show beside what a model may lack, and the log-likelihood that it gains.

    That is forces over velocity, direction and position: beside a pendulum's weight, say, an inertia shows that the
    plain model hides. The values of the fit give the force of the drive and of the couplings.
    """
    theta, shift = _split(form, fit.point)
    acceleration = form.inertial[:, body]
    force = form.inertia(theta)[body] * acceleration - form.residual(theta, shift)[:, body]
    both, others = np.column_stack([acceleration, force]), form.beside_inertia(body)
    own, left = (both - others @ np.linalg.lstsq(others, both, rcond=None)[0]).T
    inertia = float(own @ left) / max(float(own @ own), 1e-300)
    before, after = np.linalg.norm(left), np.linalg.norm(left - inertia * own)
    return inertia, len(left) * log(max(float(before), 1e-300) / max(float(after), 1e-300))


def fit_by_force_if_possible(engine: Engine, data: Sequence[Data], start: Array) -> WeakFit | None:
    """As `fit_by_force` at any noise level; None where the balance cannot be evaluated."""
    try:
        return fit_by_force(engine, data, start, accept_noise=True)
    except (IdloopError, np.linalg.LinAlgError):
        return None


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


def _wider(width: int) -> int:
    return max(round(_WIDER * width), width + 1)
