"""Maximum-likelihood fit of a model's force balance in weak form.

The likelihood is that of what was recorded: the command, given the motion, and of bodies without a drive the
acceleration. Its density is that of the unexplained force, Student's t, times how much of the command acts
(or the inertia): scaling all forces down, or switching the command off, gains nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import log

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.dataset import Data
from idloop.estimation.force_balance.weak_form import BLOCKS, LARGEST_REST, NARROWEST, Shares, WeakForm, weak_form
from idloop.estimation.optimisation.levenberg import box_step, difference_jacobian
from idloop.estimation.optimisation.smooth_engine import RememberingEngine
from idloop.estimation.optimisation.solve import typical_size
from idloop.estimation.statistics.student import log_density, scale_of
from idloop.physics import Engine, Model
from idloop.physics.effect import INPUT

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

# The time from stamp to action is found within these limits, in samples: a sampled loop has one by itself, and a
# differenced velocity half of one; what is later is a delay.
_EARLIEST, _LATEST = -1.0, 1.5
# A window is wide enough when sensor noise is at most this part of the unexplained force [standard deviations].
MOST_NOISE = 0.3
_WIDER = 1.4
# Model error rules where a balance leaves ten times what sensor noise makes, and at least this part of the drive's
# force; elsewhere finer views tell more.
_RULED, LEAST_UNEXPLAINED = 0.1, 0.01
# Sensors of one body whose velocities are further apart than this part of them show something of their own.
_DISAGREE = 0.02
# Values of narrower windows agree with wider ones where they are less likely there by no more than this.
# ... up to windows so many times as wide.
_AS_LIKELY, _FAR_WIDER = 3.0, 2.5
# Least part of the acceleration, as power, that must not be noise: inertia comes out too small by as much.
# Where it is to speak against predictions, it must be nearly all.
_RELIABLE, _CERTAIN = 0.8, 0.95
# A fit to prediction errors that leaves so many times the force that a disturbance may be has forces in that.
_HIDDEN = 1.5
# ... in windows of at most so many times those that resolve the motion: a period of the motion's band.
_PERIOD = 4
# Fewer windows in all do not tell a model from another.
FEWEST_ROWS = 100
# The search ends where a step promises less log-likelihood than this; one that only ranks models, where it is a
# hundredth of what tells them apart.
TOLERANCE, RANKING = 1e-4, 0.05
MOST_ITERATIONS, _MOST_DAMPING = 60, 1e8
_LINEAR_ROUNDS = 20
# Slopes are differences over this part of a parameter's size.
_SLOPE_STEP = 1e-4
# Parts of a linear step that are tried where values must suit each other, such as two levels of friction.
_SHARES = (1.0, 0.5, 0.25, 0.0)
# A window tells of its command where the balance depends on it by at least this part of the gain; below, of a part.
_TELLS = 0.5
# Coloured noise makes a standing axis seem to move: the speed below which it counts as standing is searched for in
# steps of this factor, up to a part of the typical speed, as long as one is worth so much log-likelihood.
_REST_STEP, _WORTH_A_REST = 3.0, 5.0
# A search begins on so many windows: they tell where the optimum is, and all of them where exactly.
# Where there are few times as many, it begins on all.
_DRAFT, _WORTH_A_DRAFT = 2000, 4


@dataclass(frozen=True)
class WeakFit:
    """Parameters fitted by the force balance.

    Attributes
    ----------
    form : WeakForm
    point : array, shape (k,) or (k + 1,)
        Free parameters, then the time from the stamp of a command to its action [s] where that is free.
    scale : array, shape (bodies,)
        Of Student's t distribution of the unexplained force.
    rows : array of int
        Windows that were fitted.
    log_likelihood : float
        Of these.
    iterations : int
    converged : bool
    jacobian : array, shape (rows bodies, k)
        Slopes of the normalised errors where the search ended.
    """

    form: WeakForm
    point: Array
    scale: Array
    rows: Rows
    log_likelihood: float
    iterations: int
    converged: bool
    jacobian: Array

    @property
    def theta(self) -> Array:
        """Values of the free parameters."""
        return self.point[: len(self.form.engine.free)]

    @property
    def model(self) -> Model:
        """The model with the values found."""
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
    def relatives(self) -> Array:
        """As `relative_errors`, of the records that were fitted."""
        return relative_errors(self.form, self.theta, self.shift)

    @property
    def relative(self) -> float:
        """Unexplained force over the drive's, both as rms over all windows."""
        return float(self.relatives[0])

    @cached_property
    def model_error_rules(self) -> bool:
        """Whether it is the model, and not sensor noise, that limits the balance."""
        return self.resolved and model_error_rules(self.form, self.theta, self.shift)

    @property
    def serves(self) -> bool:
        """Whether what it leaves may show what the model lacks: it is reliable and leaves a part of the force."""
        return self.reliable and float(np.max(self.relatives)) >= LEAST_UNEXPLAINED and self.relative < 1.0

    def decides_against(self, predicted: Model) -> bool:
        """Whether these values are to be trusted rather than those of a fit to prediction errors.

        Parameters
        ----------
        predicted : Model
            As of `hides_from`.
        """
        return self.model_error_rules or self.hides_from(predicted)

    def hides_from(self, predicted: Model) -> bool:
        """Whether predictions have taken a force for a disturbance which this balance accounts for.

        Parameters
        ----------
        predicted : Model
            The same model, fitted to prediction errors.
        """
        if not self.serves or self.form.reliability < _CERTAIN or self.form.width > _PERIOD * self.form.widest:
            return False
        # A disturbance that moves the axis leaves more of the force than the least squares of it do: they count what it
        # accelerates as inertia.
        disturbed = self.relative / np.sqrt(1.0 - self.relative**2)
        try:
            left = relative_errors(self.form.with_engine(RememberingEngine(predicted)), predicted.theta, self.shift)[0]
        except IdloopError:
            return True
        return not left <= _HIDDEN * disturbed

    @property
    def resolved(self) -> bool:
        """Whether the windows are so wide that sensor noise is a small part of what is unexplained of some body."""
        return bool(np.any(self.noise_share <= MOST_NOISE))

    @property
    def reliable(self) -> bool:
        """Whether the motion shows in these windows: sensors agree, and the acceleration is not mostly their noise."""
        return _motion_shows(self.form) and self.resolved

    @property
    def noise_share(self) -> Array:
        """What sensor noise alone makes of the unexplained force, by body, shape (bodies,); at most 1."""
        inertia = self.form.inertia(self.theta)
        return np.minimum(inertia * self.form.noise / self.scale, 1.0)

    def log_densities(self, form: WeakForm | None = None) -> Array:
        """Log-density of every window of these records or others, with the values that were fitted, shape (rows,)."""
        one = self.form if form is None else form
        return _log_densities(one, self.point, self.scale)

    def along(self, form: WeakForm) -> WeakFit:
        """The same values in other windows of the same records, not fitted to these."""
        residual = form.residual(*_split(form, self.point))
        scale, rows = _scales(form, self.point, residual), np.arange(form.starts[-1])
        likelihood = -_cost(_Target(form)(self.point))
        return WeakFit(form, self.point, scale, rows, likelihood, self.iterations, self.converged, np.zeros((0, 0)))

    def thinned(self, most: int) -> WeakFit:
        """The fit to about so many of the windows, evenly spread; itself where there are less."""
        form = self.form.thinned(most)
        return self if form is self.form else fit_weak(form, self.point)

    @cached_property
    def linear(self) -> tuple[Array, Array]:
        """Standardised errors of all windows (rows, bodies), and their slopes by the point (rows, bodies, k)."""
        error = _Target(self.form)(self.point)
        scale = _rms(error)
        return error / scale, self.jacobian.reshape(*error.shape, -1) / scale[:, None]

    @property
    def slopes(self) -> Array:
        """Slopes of the standardised errors by the point, shape (rows bodies, k)."""
        return self.linear[1].reshape(-1, len(self.point))

    @cached_property
    def slopes_of_force(self) -> Array:
        """Slopes of the driven body's unexplained force by the point, shape (rows, k)."""
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
        """Covariance of the point, from stretches taken as independent; NaN where nothing tells a parameter."""
        base, slopes = (part[self.rows] for part in self.linear)
        size = np.maximum(np.sqrt(np.sum(slopes**2, axis=(0, 1))), 1e-300)
        scaled = slopes / size
        flat = scaled.reshape(-1, len(size))
        bread = np.linalg.pinv(flat.T @ flat, rcond=1e-12, hermitian=True)
        scores = np.sum(base[:, :, None] * scaled, axis=1)
        sums = np.array([block.sum(axis=0) for block in np.array_split(scores, BLOCKS)])
        covariance = bread @ (sums.T @ sums) @ bread * BLOCKS / (BLOCKS - 1.0) / np.outer(size, size)
        dead = size <= 1e-12 * np.max(size)
        covariance[dead, :] = covariance[:, dead] = np.nan
        return np.asarray(covariance)

    def refitted(self, rows: Rows) -> WeakFit:
        """The same model fitted to some of the windows, to first order around this fit."""
        base, slopes = (part[rows] for part in self.linear)
        lower, upper = _limits(self.form)
        flat, move = slopes.reshape(-1, len(self.point)), np.zeros(len(self.point))
        for _ in range(_LINEAR_ROUNDS):
            error = base + slopes @ move
            weight = np.broadcast_to(1.0 / _rms(error) ** 2, error.shape).ravel()
            gradient, hessian = flat.T @ (weight * error.ravel()), flat.T @ (weight[:, None] * flat)
            step, promised = box_step(gradient, hessian, 1e-9, self.point + move, lower, upper)
            move = move + step
            if promised < TOLERANCE:
                break
        for share in _SHARES:
            point = np.clip(self.point + share * move, lower, upper)
            residual = self.form.residual(*_split(self.form, point))
            if np.all(np.isfinite(residual)):
                break
        else:
            raise IdloopError("the force balance cannot be evaluated")
        scale = _scales(self.form, point, residual, rows)
        return WeakFit(self.form, point, scale, rows, np.nan, self.iterations, self.converged, self.jacobian)


def relative_errors(form: WeakForm, theta: Array, shift: float) -> Array:
    """Unexplained force of every body over what acts on it, both as rms over all windows.

    Parameters
    ----------
    form : WeakForm
    theta, shift
        As of `WeakForm.residual`.

    Returns
    -------
    array, shape (bodies,)
        Of the driven body over the force of the drive.
    """
    left = form.residual(theta, shift)
    acting = form.inertia(theta) * form.inertial - left
    acting[:, 0] = form.drive(theta, shift)
    return np.asarray(np.linalg.norm(left, axis=0) / np.maximum(np.linalg.norm(acting, axis=0), 1e-300))


def model_error_rules(form: WeakForm, theta: Array, shift: float) -> bool:
    """Whether it is the model, and not sensor noise, that limits a balance in windows that resolve the motion.

    Parameters
    ----------
    form : WeakForm
    theta, shift
        As of `WeakForm.residual`.
    """
    if not _motion_shows(form):
        return False
    inertia = form.inertia(theta)
    wide: WeakForm | None = form
    while wide is not None and wide.width <= form.widest:
        left = np.sqrt(np.mean(wide.residual(theta, shift) ** 2, axis=0))
        if np.all(inertia * wide.noise <= _RULED * left):
            return float(np.max(relative_errors(wide, theta, shift))) >= LEAST_UNEXPLAINED
        wide = weak_form(form.engine, form.data, _wider(wide.width))
    return False


def _motion_shows(form: WeakForm) -> bool:
    """Whether sensors agree on the motion, and its acceleration is not mostly their noise."""
    return form.disagreement <= _DISAGREE and form.reliability >= _RELIABLE


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


def _shares(form: WeakForm, point: Array) -> Shares:
    """By what every window is told.

    What shapes the command is measured by what the drive does of it over all windows: on a command of two levels an
    uneven gain is an offset. A friction that takes a part of what the drive gives is measured window by window.
    """
    known = form.shares.get(key := point.tobytes())
    if known is not None:
        return known
    theta, shift = _split(form, point)
    slope = form.slope(theta, shift)
    least = _TELLS * form.gain(theta)
    overall, each = form.drives(theta, shift, least)
    passed = np.where(each > 0.0, slope / np.maximum(each, 1e-300), 1.0)
    cut_off = (1.0 - np.minimum(each / least, 1.0)) * (1.0 - form.standing)
    told = np.minimum(np.minimum(slope / least, 1.0), 1.0 - cut_off)
    found = Shares(told, 1.0 - told - cut_off, np.log(overall * np.maximum(passed, 1e-300)))
    form.shares.clear()
    form.shares[key] = found
    return found


def _errors(form: WeakForm, theta: Array, residual: Array, standing: Array) -> Array:
    """Unexplained force on the driven body in every window; the inertial force of one that a friction holds."""
    return np.asarray(residual[:, 0] + standing * form.inertia(theta)[0] * form.inertial[:, 0])


def _strength_of_motion(form: WeakForm, theta: Array) -> Array:
    """Log of the force per input that a window counts with where its motion is told, shape (rows,)."""
    return np.asarray(log(max(form.inertia(theta)[0], 1e-300)) - form.motion_per_input)


def _log_densities(form: WeakForm, point: Array, scale: Array) -> Array:
    theta, shift = _split(form, point)
    residual = form.residual(theta, shift)
    shares = _shares(form, point)
    total = log_density(_errors(form, theta, residual, shares.standing), float(scale[0]))
    total = total + shares.told * shares.strength + (1.0 - shares.told) * _strength_of_motion(form, theta)
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
    """What a fit makes small, shape (rows, bodies): n times the logarithm of its rms is minus the log-likelihood.

    Most parameters do not move how many windows tell of their command; those that do have it evaluated anew.
    Where all are told alike this is the unexplained force over the gain, which has no second optimum in parameters
    that the force is linear in.
    """

    def __init__(self, form: WeakForm, *, alike: bool = False) -> None:
        self.form = form
        self._alike = alike
        self._moves = np.array([_moves_slope(form.engine.model, name) for name in form.engine.free], dtype=bool)
        self._known: tuple[bytes, _Counts] | None = None

    def __call__(self, point: Array) -> Array:
        theta, shift = _split(self.form, point)
        residual, rows = self.form.residual(theta, shift), self.form.starts[-1]
        key = theta[self._moves].tobytes()
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
        if self._alike:
            strength = log(self.form.gain(_split(self.form, point)[0]))
            return _Counts(np.zeros(rows), float(rows), np.zeros(rows), -rows * strength)
        shares = _shares(self.form, point)
        held = float(np.sum(shares.standing))
        # A body that stands adds no error to the rms, of which half a unit is each other window's.
        constant = -float(np.sum(shares.told * shares.strength)) - 0.5 * held
        return _Counts(shares.standing, max(rows - held, 1e-9), 1.0 - shares.told, constant)


@dataclass(frozen=True)
class _Counts:
    """What a target needs of the shares of all windows.

    Attributes
    ----------
    standing : array, shape (rows,)
    moving : float
        Windows that are in the scale.
    silent : array, shape (rows,)
        Share that is told by the motion.
    constant : float
        Minus the log-likelihood that no other parameter moves.
    """

    standing: Array
    moving: float
    silent: Array
    constant: float


def _moves_slope(model: Model, name: str) -> bool:
    """Whether a parameter has a part in how far the balance of the driven body depends on the command."""
    owner = name.rpartition(".")[0]
    acting = (active.effect for active in model.effects if active.name == owner)
    return owner == "drive" or any(effect.site == INPUT or effect.friction is not None for effect in acting)


def fit_weak(
    form: WeakForm,
    start: Array,
    *,
    rounds: int = MOST_ITERATIONS,
    tolerance: float = TOLERANCE,
    alike: bool = False,
) -> WeakFit:
    """Fit a model to a force balance.

    Parameters
    ----------
    form : WeakForm
    start : array, shape (k,) or (k + 1,)
        Free parameters, and the timing where that is free (0 when left out).
    rounds : int
        Most iterations.
    tolerance : float
        Log-likelihood that a further iteration must promise.
    alike : bool
        Take every window as one that tells of its command: not the likelihood, but a place to search for it from.

    Raises
    ------
    IdloopError
        The balance cannot be evaluated at the start.
    """
    lower, upper = _limits(form)
    point = np.clip(start if len(start) == len(lower) else np.append(start, 0.0), lower, upper)
    size = _sizes(form, point)
    step = _SLOPE_STEP * size
    if not np.all(np.isfinite(form.residual(*_split(form, point)))):
        raise IdloopError("the force balance cannot be evaluated at the starting values")
    target = _Target(form, alike=alike)
    damping, converged, iteration = 1e-3, False, 0
    size_of_errors, jacobian = np.ones(0), np.zeros((0, len(point)))
    while iteration < rounds and not converged:
        iteration += 1
        error = target(point)
        size_of_errors = scale = _rms(error)
        cost = _cost(error)
        base = (error / scale).ravel()

        def scaled(at: Array, scale: Array = scale) -> Array:
            return (target(at) / scale).ravel()

        jacobian, step = difference_jacobian(scaled, point, base, lower, upper, step, size, central=False)
        jacobian[:, ~np.all(np.isfinite(jacobian), axis=0)] = 0.0
        gradient, hessian = jacobian.T @ base, jacobian.T @ jacobian
        accepted = False
        while damping <= _MOST_DAMPING:
            move, predicted = box_step(gradient, hessian, damping, point, lower, upper)
            if predicted <= tolerance:
                converged = True
                break
            trial = np.clip(point + move, lower, upper)
            left = target(trial)
            if np.all(np.isfinite(left)):
                now = _cost(left)
                if now < cost:
                    accepted, converged, point = True, cost - now < tolerance, trial
                    damping = max(0.1 * damping, 1e-9)
                    break
            damping *= 8.0
        if not accepted:
            converged = converged or damping > _MOST_DAMPING
            break
        size = np.maximum(size, np.abs(point))
    scale = _scales(form, point, form.residual(*_split(form, point)))
    likelihood = -_cost(target(point))
    unscaled = (jacobian.reshape(form.starts[-1], -1, len(point)) * size_of_errors[:, None]).reshape(jacobian.shape)
    return WeakFit(form, point, scale, np.arange(form.starts[-1]), likelihood, iteration, converged, unscaled)


def _rms(error: Array) -> Array:
    """Root mean square of every column, never 0."""
    return np.asarray(np.maximum(np.sqrt(np.mean(error**2, axis=0)), 1e-300))


def cost_at(form: WeakForm, start: Array) -> float:
    """Minus the log-likelihood of a point from which a fit may begin; infinite where it has no balance."""
    lower, upper = _limits(form)
    point = np.clip(start if len(start) == len(lower) else np.append(start, 0.0), lower, upper)
    error = _Target(form)(point)
    return _cost(error) if np.all(np.isfinite(error)) else np.inf


def _cost(error: Array) -> float:
    """Minus the log-likelihood of normalised errors, their scale at its best, but for a constant."""
    return float(len(error) * np.sum(np.log(_rms(error))))


def fit_by_force(
    engine: Engine,
    data: Sequence[Data],
    start: Array,
    known: dict[int, WeakForm] | None = None,
    *,
    insist: bool = False,
    rest_speed: float | None = None,
    narrowest: int = NARROWEST,
) -> WeakFit | None:
    """Fit a model to records by its force balance, in the narrowest windows in which sensor noise does not rule.

    Of any body; where there are none, of some body. Where it is much of the acceleration, the inertia comes out too
    small, and with it the noise in units of force: windows that are widened for that must agree with yet wider ones.

    Parameters
    ----------
    engine : Engine
    data : sequence of Data
    start : array, shape (k,)
    known : dict of int to WeakForm, optional
        Windows of these data by width, for other effects in the same machine; what is made anew is added.
    insist : bool
        Take the widest windows where sensor noise rules in all.
    rest_speed : float, optional
        Speed below which a body counts as standing to search from [m/s or rad/s].
    narrowest : int
        Samples in the windows to begin with.

    Returns
    -------
    WeakFit or None
        None where some body is not measured, or sensor noise is what a balance would show at any width.

    Raises
    ------
    IdloopError
        The balance cannot be evaluated at the start.
    """
    width, point = narrowest, start
    forms = {} if known is None else known
    found: WeakFit | None = None
    # Of a body that lacks nothing noise is all that is left, at any width.
    for_some: WeakFit | None = None
    ruled, narrower = False, None
    while True:
        form = forms[width].with_engine(engine) if width in forms else weak_form(engine, data, width)
        if form is None or form.starts[-1] < FEWEST_ROWS:
            return for_some or (found if insist else None)
        forms.setdefault(width, form)
        form = form if rest_speed is None else form.with_rest_speed(rest_speed)
        found = with_rest_speed(fit_anew(form, point) if width == narrowest else fit_weak(form, point))
        if narrower is not None and _agrees(narrower, found):
            if width >= _FAR_WIDER * narrower.form.width:
                return narrower
            width = _wider(width)
            continue
        narrower = None
        if form.reliability < _RELIABLE:
            ruled = True
        elif np.all(found.noise_share <= MOST_NOISE):
            if not ruled:
                return found
            # Coloured noise is no white one, and only wider windows show how much it has been.
            narrower = found
        elif not ruled:
            for_some = for_some or (found if found.resolved else None)
        width, point = _wider(width), found.theta


def _agrees(narrower: WeakFit, wider: WeakFit) -> bool:
    """Whether the values of narrower windows are nearly as likely in wider ones as their own."""
    return cost_at(wider.form, narrower.point) + wider.log_likelihood <= _AS_LIKELY


def with_rest_speed(fit: WeakFit, tolerance: float = TOLERANCE) -> WeakFit:
    """The fit with a speed below which bodies count as standing as large as is likely, where it has a dry friction.

    Parameters
    ----------
    fit : WeakFit
    tolerance : float
        As of `fit_weak`.
    """
    while (likelier := likelier_rest_speed(fit.form, fit.point)) is not None:
        fit = fit_weak(likelier, fit.point, tolerance=tolerance)
    return fit


def likelier_rest_speed(form: WeakForm, point: Array) -> WeakForm | None:
    """The same windows with a larger speed below which bodies count as standing, where that is far likelier.

    Parameters
    ----------
    form : WeakForm
    point : array, shape (k,) or (k + 1,)
        As the start of `fit_weak`.

    Returns
    -------
    WeakForm or None
        None where it is not, or the model has no dry friction.
    """
    if not any(active.effect.friction is not None for active in form.engine.model.effects):
        return None
    faster = form.with_rest_speed(min(_REST_STEP * form.rest_speed, LARGEST_REST * form.typical_speed))
    if faster.rest_speed <= form.rest_speed:
        return None
    return faster if cost_at(faster, point) < cost_at(form, point) - _WORTH_A_REST else None


def draft_of(form: WeakForm) -> WeakForm:
    """The windows on which a search begins: all where a draft would save little."""
    return form.thinned(_DRAFT) if form.starts[-1] >= _WORTH_A_DRAFT * _DRAFT else form


def fit_anew(form: WeakForm, start: Array) -> WeakFit:
    """Fit a model to a force balance from two starts: one, and where taking all windows alike leads from there.

    Parameters
    ----------
    form, start
        As of `fit_weak`.

    Returns
    -------
    WeakFit
        The likelier one.

    Raises
    ------
    IdloopError
        The balance cannot be evaluated at the start.
    """
    draft = draft_of(form)
    alike = fit_weak(draft, start, alike=True)
    found = max(fit_weak(draft, start), fit_weak(draft, alike.point), key=_likelihood)
    return found if draft is form else fit_weak(form, found.point)


def _likelihood(fit: WeakFit) -> float:
    return fit.log_likelihood


def _wider(width: int) -> int:
    return max(round(_WIDER * width), width + 1)
