"""The maximum-likelihood fit that a user asks for, from the starting values and from those of the force balance.

A diagnosis stays near the user's values instead: where an effect is missing, the global optimum may be a model that the
drive hardly moves, in which no effect gains much.
"""

from __future__ import annotations

import numpy as np

from idloop.errors import IdloopError
from idloop.estimation.force_balance.window_width import fit_by_force_if_possible
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.likelihood.refit import Refit, refit, refit_or_none
from idloop.physics.model import Model

# Gain of log-likelihood above which a search has found another optimum, not only more digits of the same.
_ANOTHER_OPTIMUM = 2.0


def first_fit(estimation: EstimationProblem, model: Model) -> Refit:
    """Maximise the likelihood from the model's values, and from those of the force balance where these are likelier.

    The balance is nearly linear in the parameters: it comes near the optimum from any starting values. Raises
    `IdloopError` where the model can be simulated from neither.
    """
    found: Refit | None = None
    failure: IdloopError | np.linalg.LinAlgError | None = None
    try:
        found = refit(estimation, model)
    except (IdloopError, np.linalg.LinAlgError) as error:
        failure = error
    near = fit_by_force_if_possible(estimation.engine(model), estimation.data, model.theta)
    other = None if near is None else refit_or_none(estimation, near.model, near=True)
    if other is not None and (found is None or other.log_likelihood > found.log_likelihood + _ANOTHER_OPTIMUM):
        found = refit(estimation, other.model)
    if found is None:
        raise failure or IdloopError("the model cannot be fitted")
    return found
