"""Likelihood of a force balance in weak form, window by window.

It is that of the recorded command, given the motion, and of the acceleration of bodies without a drive. Its density is
Student's t of the unexplained force, times the derivative of the balance by the command (or the inertia): scaling all
forces down, or switching the command off, gains nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array
from idloop.estimation.force_balance.weak_form import WeakForm, WindowShares
from idloop.estimation.optimisation.solve import typical_size
from idloop.estimation.statistics.student import log_density, scale_of
from idloop.physics import Model
from idloop.physics.effect import INPUT

Rows = NDArray[np.int64]

# Limits of the time from the stamp of a command to its action, in samples; a larger delay is an effect of the model.
_EARLIEST, _LATEST = -1.0, 1.5
# Name of the time from the stamp of a command to its action beside those of the free parameters.
_TIMING = "timing"
# A window counts fully by its command where the balance depends on that by at least this part of the gain.
_FULL_RESPONSE = 0.5


def point_limits(form: WeakForm) -> tuple[Array, Array]:
    """Bounds of a point: of the free parameters, and of the timing of the command where that is free."""
    lower, upper = form.engine.model.bounds
    if not form.free_timing:
        return lower, upper
    step = form.sample_time
    return np.append(lower, _EARLIEST * step), np.append(upper, _LATEST * step)


def point_sizes(form: WeakForm, point: Array) -> Array:
    """Typical size of every number of a point."""
    lower, upper = form.engine.model.bounds
    size = typical_size(point[: len(lower)], lower, upper)
    return np.append(size, form.sample_time) if form.free_timing else size


def split_point(form: WeakForm, point: Array) -> tuple[Array, float]:
    """Free parameters, and the time from the stamp of a command to its action [s]."""
    return (point[:-1], float(point[-1])) if form.free_timing else (point, 0.0)


def window_shares(form: WeakForm, point: Array) -> WindowShares:
    """By what every window counts.

    An effect at the input is measured over all windows: on a command of two levels a gain asymmetry equals an offset. A
    friction that absorbs a part of the drive's force is measured window by window.
    """
    known = form.shares.get(key := point.tobytes())
    if known is not None:
        return known
    theta, shift = split_point(form, point)
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


def window_densities(form: WeakForm, point: Array, scale: Array) -> Array:
    """Log-density of every window, shape (rows,)."""
    theta, shift = split_point(form, point)
    residual = form.residual(theta, shift)
    shares = window_shares(form, point)
    total = log_density(_errors(form, theta, residual, shares.standing), float(scale[0]))
    total = total + shares.command * shares.strength + (1.0 - shares.command) * _strength_of_motion(form, theta)
    inertia = form.inertia(theta)
    for body in range(1, residual.shape[1]):
        total = total + log_density(residual[:, body], float(scale[body])) + np.log(inertia[body])
    return np.asarray(total)


def force_scales(form: WeakForm, point: Array, residual: Array, rows: Rows | slice = slice(None)) -> Array:
    """Scale of every body's unexplained force, shape (bodies,)."""
    shares = window_shares(form, point)
    errors = _errors(form, split_point(form, point)[0], residual, shares.standing)
    scale = scale_of(errors[rows], float(np.sum(1.0 - shares.standing[rows])))
    return np.array([scale, *(scale_of(column) for column in residual[rows, 1:].T)])


class NormalisedErrors:
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
        """The errors at a point; not finite where the balance cannot be evaluated."""
        theta, shift = split_point(self.form, point)
        residual, rows = self.form.residual(theta, shift), self.form.starts[-1]
        if not np.all(np.isfinite(residual)):
            return np.full(residual.shape, np.nan)
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
            strength = log(self.form.gain(split_point(self.form, point)[0]))
            return _Counts(np.zeros(rows), float(rows), np.zeros(rows), -rows * strength)
        shares = window_shares(self.form, point)
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


def rms_of_columns(error: Array) -> Array:
    """Root mean square of every column, never 0."""
    return np.asarray(np.maximum(np.sqrt(np.mean(error**2, axis=0)), 1e-300))


def cost_at(form: WeakForm, start: Array) -> float:
    """Minus the log-likelihood at a start of a fit; infinite where the balance cannot be evaluated."""
    lower, upper = point_limits(form)
    point = np.clip(start if len(start) == len(lower) else np.append(start, 0.0), lower, upper)
    error = NormalisedErrors(form)(point)
    return cost_of(error) if np.all(np.isfinite(error)) else np.inf


def cost_of(error: Array) -> float:
    """Minus the log-likelihood of normalised errors at their best scale, without a constant."""
    return float(len(error) * np.sum(np.log(rms_of_columns(error))))
