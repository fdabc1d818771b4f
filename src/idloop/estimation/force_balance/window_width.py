"""Fit by a force balance in windows as narrow as sensor noise allows."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

import numpy as np

from idloop.arrays import Array, Mask
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data
from idloop.estimation.force_balance.weak_fit import (
    FEWEST_ROWS,
    LEAST_RELIABLE,
    MOST_NOISE,
    RANKING_TOLERANCE,
    WeakFit,
    draft_windows,
    fit_from_two_starts,
    fit_weak,
    wider_than,
    with_rest_speed,
)
from idloop.estimation.force_balance.weak_form import NARROWEST, WeakForm, weak_form
from idloop.estimation.force_balance.weak_likelihood import cost_at, force_scales, split_point
from idloop.physics import Engine

# Narrow windows agree with those wider by these ratios where they show at least that part of the inertia, or where
# their values lose at most this log-likelihood there. Noise with a memory averages out slowly: the first shows little.
_FAR_WIDER, _SAME_INERTIA, _AS_LIKELY = (2.5, 6.25), 0.95, 3.0
# Noise hides an inertia from narrow windows where wide ones show it with so many times the log-likelihood.
_FAR_BETTER = 2.0


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
    `accept_noise`: where no windows qualify, use the narrowest that noise does not dominate, else the widest.
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
    # What all windows show otherwise than those wider by a factor is no work of noise.
    resolved: WeakFit | None = None
    noisy, skipped = False, None
    while True:
        form = _windows(engine, data, width, forms)
        if form is None:
            best = partly_resolved or (resolved if accept_noise else None)
            if best is None and accept_noise and skipped is not None:
                return with_rest_speed(fit_weak(skipped, point))
            return best or (found if accept_noise else None)
        form = form if rest_speed is None else form.with_rest_speed(rest_speed)
        noisy = noisy or form.reliability < LEAST_RELIABLE
        if found is not None and _mostly_noise(form, found.point):
            skipped, width = form, wider_than(width)
            continue
        skipped = None
        found = with_rest_speed(fit_from_two_starts(form, point) if width == narrowest else fit_weak(form, point))
        # No body is without inertia: where a fit finds none, noise has hidden it.
        free = found.form.engine.free
        noisy = noisy or any(name.endswith(".inertia") for name, at in zip(free, _at_limit(found), strict=True) if at)
        if form.reliability >= LEAST_RELIABLE and found.resolved:
            resolved = resolved or found
            attenuated = _underestimates_inertia(found, start, forms, noisy=noisy)
            noisy = noisy if attenuated is None else attenuated or _noise_hides_inertia(found, forms)
            if not noisy and np.all(found.noise_share <= MOST_NOISE):
                return found
            partly_resolved = partly_resolved or (None if noisy else found)
        width, point = wider_than(width), _off_limits(found, start)


def _off_limits(fit: WeakFit, start: Array) -> Array:
    """Values of a fit, and those of the start where they are at a limit: a search there may see no way back."""
    return np.where(_at_limit(fit), start[: len(fit.theta)], fit.theta)


def _at_limit(fit: WeakFit) -> Mask:
    """Which free parameters are at a limit, shape (k,)."""
    lower, upper = fit.form.engine.model.bounds
    return np.asarray((fit.theta <= lower) | (fit.theta >= upper))


def _mostly_noise(form: WeakForm, point: Array) -> bool:
    """Whether noise dominates whatever is fitted: it does in what these values leave, and a fit leaves less."""
    if form.reliability < LEAST_RELIABLE:
        return True
    theta, shift = split_point(form, point)
    left = force_scales(form, point, form.residual(theta, shift))
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

    None where there are too few of them, or where they show less for some body. Noise of unknown colour, as of a jitter
    of the stamps, is underestimated, and with it how much it attenuates. Where it was much of the acceleration in
    narrower windows (`noisy`), the values must be as likely as the others; else they must not leave much more.
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
    if np.any(wide < _SAME_INERTIA * narrow):
        # Noise takes inertia away; what shifts it from one body to another is a force that is missing.
        return None
    lost = cost_at(wider.form, fit.point) + wider.log_likelihood
    return lost > (_AS_LIKELY if noisy else -log(LEAST_RELIABLE) * wider.form.starts[-1])


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
    theta, shift = split_point(form, fit.point)
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
