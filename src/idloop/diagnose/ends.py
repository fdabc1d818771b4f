"""Where searches from several starts end."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from idloop.diagnose.confirm import MORE_ROUNDS
from idloop.estimate.likelihood.parallel import in_parallel
from idloop.estimate.likelihood.refit import Refit, refit_or_none
from idloop.estimate.likelihood.setting import Setting
from idloop.physics.model import Model


def ends(
    setting: Setting,
    model: Model,
    choices: Sequence[Mapping[str, float]],
    beside: Refit | None = None,
    most: int | None = None,
) -> list[Refit]:
    """Where searches from several starts end, each by itself, best first: the nearest start need not lead to the best.

    Parameters
    ----------
    setting : Setting
    model : Model
    choices : sequence of mapping
        Values to start from, the model's own for what they leave out.
    beside : Refit, optional
        As in `idloop.estimate.likelihood.refit.refit`.
    most : int, optional
        After a first round no more than so many are carried on.
    """

    def search(values: Mapping[str, float], begun: Refit | None = None) -> Refit | None:
        theta = np.array([values.get(name, model.values[name]) for name in model.free])
        rounds = 1 if begun is None else MORE_ROUNDS
        return refit_or_none(setting, model, [theta], begun or beside, rounds=rounds) or begun

    begun = best_first(in_parallel(search, choices))[:most]
    return best_first(in_parallel(lambda fit: search(fit.model.values, fit), begun))


def best_first(fits: Iterable[Refit | None]) -> list[Refit]:
    """Sort fits by falling likelihood, without those that failed."""
    return sorted((fit for fit in fits if fit is not None), key=lambda fit: -fit.log_likelihood)
