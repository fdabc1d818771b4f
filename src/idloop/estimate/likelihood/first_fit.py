"""The fit to prediction errors that `fit`, `diagnose` and `refine` begin with: one search, one answer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimate.likelihood.disturbance import SETTLED
from idloop.estimate.likelihood.refit import Refit, refit, refit_or_none
from idloop.estimate.likelihood.setting import Setting
from idloop.estimate.weak_fit import fit_by_force
from idloop.estimate.weak_form import WeakForm
from idloop.physics.model import Model

Array = NDArray[np.float64]


def first_fit(setting: Setting, model: Model, forms: dict[int, WeakForm] | None = None) -> Refit:
    """Maximise the likelihood from the user's values, and from those of the force balance where these are likelier.

    A balance is nearly linear in the parameters: it finds the machine from anywhere, if not exactly. Windows of the
    records that are made for it are added to `forms`. Raises `IdloopError` where the model can be simulated from
    neither.
    """
    found: Refit | None = None
    failure: IdloopError | np.linalg.LinAlgError | None = None
    try:
        found = refit(setting, model)
    except (IdloopError, np.linalg.LinAlgError) as error:
        failure = error
    near = _near(setting, model, forms) if setting.kind == "prediction" else None
    other = None if near is None else refit_or_none(setting, model.with_theta(near), near=True)
    if other is not None and (found is None or other.log_likelihood > found.log_likelihood + SETTLED):
        found = refit(setting, other.model)
    if found is None:
        raise failure or IdloopError("the model cannot be fitted")
    return found


def first_fit_or_none(setting: Setting, model: Model, forms: dict[int, WeakForm] | None = None) -> Refit | None:
    """As `first_fit`; None where the model cannot be simulated."""
    try:
        return first_fit(setting, model, forms)
    except (IdloopError, np.linalg.LinAlgError):
        return None


def _near(setting: Setting, model: Model, forms: dict[int, WeakForm] | None) -> Array | None:
    """Values that a force balance finds, in whatever noise; None where there is none."""
    try:
        fit = fit_by_force(setting.engine(model), setting.data, model.theta, forms, insist=True)
    except (IdloopError, np.linalg.LinAlgError):
        return None
    return None if fit is None else fit.theta
