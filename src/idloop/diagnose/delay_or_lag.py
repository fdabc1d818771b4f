"""Which effect with a memory it is that a force balance has found before the drive.

A window of a balance sees a delay and a lag alike: by what they make of quick changes of the command. One-step
predictions tell them apart.
"""

from __future__ import annotations

from idloop.diagnose.candidate import Candidate
from idloop.diagnose.diagnosis import candidate_of
from idloop.diagnose.prediction_view import PredictionView
from idloop.estimate.likelihood.refit import refit_or_none
from idloop.estimate.likelihood.setting import Setting
from idloop.physics.effect import INPUT
from idloop.physics.model import Model


def delay_or_lag(model: Model, name: str, setting: Setting, level: float, seed: int) -> tuple[Candidate, ...]:
    """What predictions name in the place of an effect of a model.

    Parameters
    ----------
    model : Model
        Fitted by its force balance.
    name : str
        Of its effect.
    setting : Setting
        Of predictions.
    level : float
        Probability of naming an effect where nothing is missing.
    seed : int

    Returns
    -------
    tuple of Candidate
        The best, and those that predictions do not tell from it. Empty where the effect has no memory or does not act
        on the command, and where predictions name just that or nothing.
    """
    active = next((active for active in model.effects if active.name == name), None)
    if active is None or active.effect.site != INPUT or not active.effect.lags:
        return ()
    bare = refit_or_none(setting, model.without_effect(name))
    if bare is None:
        return ()
    step = PredictionView(setting, model, level, 0.0, [name, *active.effect.looks_like], seed=seed).weigh(bare)
    if not step.tied or step.names == (name,):
        return ()
    return tuple(candidate_of(step, one, 0, step.reported(one.fit)) for one in step.tied)
