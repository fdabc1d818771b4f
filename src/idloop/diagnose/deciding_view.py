"""Whether the force balance of a model serves, and may decide what it lacks."""

from __future__ import annotations

import math

from idloop.diagnose.anchor import LEFT_BEHIND
from idloop.diagnose.refit import refit_or_none
from idloop.diagnose.setting import Setting, prepare_setting
from idloop.errors import InputError
from idloop.estimate.engine import RememberingEngine
from idloop.estimate.weak_fit import WeakFit, draft_of, fit_anew, fit_by_force
from idloop.estimate.weak_form import WeakForm
from idloop.physics.model import Model

# Where the best model leaves this part of the drive's force, it is not the force that moves the axis.
NOTHING = 0.9
# With the command turned a model explains far more where it leaves less than this part of what it leaves otherwise.
_FAR_LESS = 0.5
# Samples that mostly tell whether predictions are better with an effect that the force balance shows.
_BEGINNINGS = 4000


def deciding_fit(model: Model, setting: Setting, forms: dict[int, WeakForm]) -> WeakFit | None:
    """The model fitted by its force balance, where that may decide what it lacks.

    Parameters
    ----------
    model : Model
    setting : Setting
    forms : dict of int to WeakForm
        Windows of the records by width; what is made anew is added.

    Returns
    -------
    WeakFit or None
        None where some body is not measured, where sensor noise is what it would show, where the command is turned, and
        where what it shows is a feedback.
    """
    fit = fit_by_force(RememberingEngine(model), setting.data, model.theta, forms)
    serves = fit is not None and fit.model_error_rules and setting.shows(fit.model) and not _against_the_command(fit)
    return fit if serves else None


def asked_fit(model: Model, setting: Setting, forms: dict[int, WeakForm]) -> WeakFit:
    """The model fitted by its force balance, which was asked for: it decides wherever it can be evaluated.

    Parameters
    ----------
    model, setting, forms
        As of `deciding_fit`.

    Raises
    ------
    InputError
        It cannot be evaluated.
    """
    fit = fit_by_force(RememberingEngine(model), setting.data, model.theta, forms, insist=True)
    if fit is None:
        raise InputError(
            "the force criterion needs every body's position or velocity at a steady rate, and some hundred samples; "
            "use prediction"
        )
    return fit


def contradicted(start: Model, found: Model, setting: Setting, level: float) -> bool:
    """Whether predictions of the next sample are no better for what a force balance has found.

    Where a disturbance moves an axis and a loop answers it, the balance shows that loop and not the axis. Predictions
    have the disturbance for what it is; but they may take a missing friction for one, too, and an axis that the drive
    hardly moves. What they say of that is no contradiction.

    Parameters
    ----------
    start, found : Model
        Before and after the balance has added to it.
    setting : Setting
        Of predictions.
    level : float
        Probability of naming an effect where nothing is missing.
    """
    part = _beginnings(setting, start)
    # How long records begin mostly says enough; where it does not, all of them are asked.
    return (part is None or _denies(start, found, part, level)) and _denies(start, found, setting, level)


def _beginnings(setting: Setting, start: Model) -> Setting | None:
    """How the records begin, as a setting of its own; None where they are short, or begin without a motion."""
    samples = sum(len(record.time) for record in setting.records)
    if samples < 2 * _BEGINNINGS:
        return None
    ends = [record.time[(len(record.time) - 1) * _BEGINNINGS // samples] for record in setting.records]
    try:
        cut = [record.cut(None, float(end)) for record, end in zip(setting.records, ends, strict=True)]
        return prepare_setting(start, cut, setting.kind)
    except InputError:
        return None


def _denies(start: Model, found: Model, setting: Setting, level: float) -> bool:
    plain = refit_or_none(setting, start)
    if plain is None or _push(plain.model) < _push(start) / LEFT_BEHIND:
        return False
    after = refit_or_none(setting, found)
    return after is not None and after.log_likelihood - plain.log_likelihood < math.log(1.0 / level)


def _push(model: Model) -> float:
    """Acceleration of the driven body for a command, less its friction [position/s² per input]."""
    values = model.values
    return abs(values["drive.gain"]) / max(values[f"{model.bodies[0]}.inertia"], 1e-300)


def _against_the_command(fit: WeakFit) -> bool:
    """Whether the same model explains far more of the force with the sign of the command turned."""
    return fit_anew(draft_of(fit.form).turned(), fit.point).relative < _FAR_LESS * fit.relative
