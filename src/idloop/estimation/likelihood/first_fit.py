"""The fit to prediction errors that a user asks for: that with which a ladder begins, or a likelier one.

A diagnosis keeps near the user's values: where an effect is missing, the likeliest model may be one that its drive
hardly moves, and from there no effect promises much.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.force_balance.weak_fit import fit_by_force
from idloop.estimation.likelihood.estimation_problem import Setting
from idloop.estimation.likelihood.refit import Refit, refit, refit_or_none
from idloop.physics.model import Model

Array = NDArray[np.float64]

# A search that ends likelier by this has found another optimum, and not only more of its digits.
_LIKELIER = 2.0


def first_fit(setting: Setting, model: Model) -> Refit:
    """Maximise the likelihood from the user's values, and from those of the force balance where these are likelier.

    A balance is nearly linear in the parameters: it finds the machine from anywhere, if not exactly. Raises
    `IdloopError` where the model can be simulated from neither.
    """
    found: Refit | None = None
    failure: IdloopError | np.linalg.LinAlgError | None = None
    try:
        found = refit(setting, model)
    except (IdloopError, np.linalg.LinAlgError) as error:
        failure = error
    near = _near(setting, model) if setting.kind == "prediction" else None
    other = None if near is None else refit_or_none(setting, model.with_theta(near), near=True)
    if other is not None and (found is None or other.log_likelihood > found.log_likelihood + _LIKELIER):
        found = refit(setting, other.model)
    if found is None:
        raise failure or IdloopError("the model cannot be fitted")
    return found


def _near(setting: Setting, model: Model) -> Array | None:
    """Values that a force balance finds, in whatever noise; None where there is none."""
    try:
        fit = fit_by_force(setting.engine(model), setting.data, model.theta, insist=True)
    except (IdloopError, np.linalg.LinAlgError):
        return None
    return None if fit is None else fit.theta
