"""Whether the force balance of a model serves, and may decide what it lacks."""

from __future__ import annotations

from idloop.diagnose.setting import Setting
from idloop.errors import InputError
from idloop.estimate.engine import RememberingEngine
from idloop.estimate.weak_fit import WeakFit, draft_of, fit_anew, fit_by_force
from idloop.estimate.weak_form import WeakForm
from idloop.physics.model import Model

# Where the best model leaves this part of the drive's force, it is not the force that moves the axis.
NOTHING = 0.9
# With the command turned a model explains far more where it leaves less than this part of what it leaves otherwise.
_FAR_LESS = 0.5


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
        None where some body is not measured, where sensor noise is what it would show, and where the command is turned.
    """
    fit = fit_by_force(RememberingEngine(model), setting.data, model.theta, forms)
    serves = fit is not None and fit.model_error_rules and not _against_the_command(fit)
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


def _against_the_command(fit: WeakFit) -> bool:
    """Whether the same model explains far more of the force with the sign of the command turned."""
    return fit_anew(draft_of(fit.form).turned(), fit.point).relative < _FAR_LESS * fit.relative
