"""The best of several searches from nearby.

Beside a play, or another effect that remembers, the likelihood is rough: contact comes a sample sooner or later, and a
search ends in one of many hollows. A candidate is the best of many searches; its parent must have had as many before a
gain of a few units counts.
"""

from __future__ import annotations

import numpy as np

from idloop.diagnose.intervals import with_stderr
from idloop.diagnose.parallel import in_parallel
from idloop.diagnose.refit import Refit, refit_or_none
from idloop.diagnose.setting import Setting
from idloop.physics.model import Model

# Searches, and how far from the best point known they begin [standard errors].
COUNT, SPREAD = 8, 1.0


def restarted(setting: Setting, fit: Refit, seed: int = 0) -> Refit:
    """Search again from points about a fit.

    Parameters
    ----------
    setting : Setting
    fit : Refit
    seed : int
        Of the points.

    Returns
    -------
    Refit
        The best of all; the fit itself where no other is better.
    """
    fitted = with_stderr(fit, setting.records)
    values = {p.name: (p.value, p.stderr or 0.0) for p in fitted.parameters if p.name in fit.model.free}
    sizes = {name: error if np.isfinite(error) else 0.0 for name, (_, error) in values.items()}
    rng = np.random.default_rng(seed)

    def moved() -> Model:
        return fit.model.with_values(
            {
                name: float(np.clip(value + SPREAD * sizes[name] * rng.normal(), *_bounds(fit.model, name)))
                for name, (value, _) in values.items()
            }
        )

    starts = [moved() for _ in range(COUNT)]
    found = in_parallel(lambda model: refit_or_none(setting, model, None, fit), starts)
    return max([fit, *(one for one in found if one is not None)], key=lambda one: one.log_likelihood)


def _bounds(model: Model, name: str) -> tuple[float, float]:
    parameter = model.parameter(name)
    return parameter.min, parameter.max
