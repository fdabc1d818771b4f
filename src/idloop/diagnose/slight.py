"""Effects that are significant and yet too slight to be taken for physics.

Clean data has the power to show differences far below what anybody means by an effect: another way to integrate the
same equations, a stamp that is a microsecond off. Where the likelihood is rough, as beside a play, a search over many
shapes may also find a gain for a strength that the errors, by their own scatter, do not tell from none. Neither is
missing physics, however small its p-value.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.candidate import effect_parameters
from idloop.diagnose.confirm import Confirmed
from idloop.diagnose.intervals import parameter_covariance, with_stderr
from idloop.diagnose.lattice import rounding_step
from idloop.diagnose.proposals import Proposal
from idloop.diagnose.refit import Refit
from idloop.errors import IdloopError
from idloop.estimate.dataset import Data, prepare
from idloop.estimate.engine import RememberingEngine
from idloop.physics.effect import OUTPUT
from idloop.physics.model import Model
from idloop.records import Record
from idloop.validate.free_run import free_runs
from idloop.validate.measures import NEGLIGIBLE

Array = NDArray[np.float64]

_HOLDS_NONE = "the 95 % interval of {} holds the value at which it does nothing"
# Half width of the 95 % interval in standard errors.
_HALF_WIDTH = 1.96
# What two squared standard normal values together exceed once in twenty times.
_TWO_SQUARES = 5.991


def too_slight(parent: Refit, confirmed: Confirmed, records: Sequence[Record]) -> str:
    """Say why a significant effect is too slight to be missing physics.

    Parameters
    ----------
    parent : Refit
        Without it.
    confirmed : Confirmed
    records : sequence of Record
        What both were fitted to.

    Returns
    -------
    str
        Empty where it is not, or where that cannot be told: of effects of the reading's steps alone, and of those that
        act beyond a level, and so for moments only.
    """
    proposal, fitted = confirmed.proposal, confirmed.fit.model
    if proposal.effect.final or proposal.effect.from_a_level:
        return ""
    if proposal.effect.splits and proposal.replaces is None:
        return "" if _gives(with_stderr(confirmed.fit, records), proposal) else _HOLDS_NONE.format("its give")
    without = fitted.without_effect(proposal.name) if proposal.replaces is None else parent.model
    if same_motion(fitted, without, records):
        return f"it moves no output by more than {100.0 * NEGLIGIBLE:g} % of its standard deviation"
    if proposal.effect.site == OUTPUT and _within_rounding(fitted, without, proposal.at, records):
        return "it moves the reading by less than half a step of its rounding"
    phase = f"{proposal.name}.phase"
    is_wave = phase in fitted.free and f"{proposal.name}.{proposal.effect.strength}" in fitted.free
    tells = _wave_tells_from_none if is_wave else _tells_from_none
    if not tells(confirmed.fit, proposal, records):
        return _HOLDS_NONE.format(
            "its strength" if proposal.replaces is None else f"what it has beyond {proposal.replaces}"
        )
    return ""


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def same_motion(model: Model, other: Model, records: Sequence[Record]) -> bool:
    """Whether two models of the same bodies move no output apart by more than a negligible part of its deviation.

    Parameters
    ----------
    model, other : Model
    records : sequence of Record
        Their commands are simulated, from the start that suits the first model best.

    Returns
    -------
    bool
        False where a simulation fails.
    """
    try:
        return all(
            np.all(
                np.sqrt(np.nanmean(apart[:, seen] ** 2, axis=0)) <= NEGLIGIBLE * np.nanstd(data.output[:, seen], axis=0)
            )
            for data, apart in _apart(model, other, records)
            for seen in [np.any(np.isfinite(data.output), axis=0)]
        )
    except IdloopError:
        return False


def _within_rounding(model: Model, other: Model, output: str, records: Sequence[Record]) -> bool:
    """Whether two models of the same motion read a sensor apart by no more than its own rounding does."""
    column = next(i for i, o in enumerate(model.outputs) if o.site == output)
    step = rounding_step(records, column)
    if step == 0.0:
        return False
    try:
        return all(np.all(np.abs(apart[:, column]) <= 0.5 * step) for _, apart in _apart(model, other, records))
    except IdloopError:
        return False


def _apart(model: Model, other: Model, records: Sequence[Record]) -> Iterator[tuple[Data, Array]]:
    """Records, and how far the free runs of two models of the same bodies come apart in them, shape (n, p)."""
    engine, second = RememberingEngine(model), RememberingEngine(other)
    for data in prepare(model, records):
        one, two = free_runs(engine, data, second)
        yield data, one - two


def _wave_tells_from_none(fit: Refit, proposal: Proposal, _: Sequence[Record]) -> bool:
    """Whether the region of a wave's two components leaves out the origin.

    Over a short arc the data tell one combination of strength and phase: the interval of the strength by itself reaches
    down to nothing, while no wave at all is far from what they say. The distance of (a cos, a sin) from the origin, in
    its own covariance, is that of the strength at the phase that was found.
    """
    places = [fit.model.free.index(f"{proposal.name}.{name}") for name in (proposal.effect.strength, "phase")]
    covariance = parameter_covariance(fit)[np.ix_(places, places)]
    if not np.all(np.isfinite(covariance)):
        return True
    strength = fit.model.values[fit.model.free[places[0]]]
    return bool(strength**2 * np.linalg.pinv(covariance)[0, 0] > _TWO_SQUARES)


def _tells_from_none(fit: Refit, proposal: Proposal, records: Sequence[Record]) -> bool:
    """Whether the interval of an effect's strength leaves out the value at which it does nothing.

    Of an effect that takes a plainer one's place, whether that holds for anything that it has beyond the plainer one.
    True where nothing says what the strength is, or how sure. The standard errors hold for errors of any colour.
    """
    effect, fitted = proposal.effect, with_stderr(fit, records)
    names = {effect.strength} if proposal.replaces is None else proposal.beyond
    found = effect_parameters(fitted, proposal.name)
    if not any(names & found.keys()) or names & set(proposal.held):
        return True
    # One that follows another where it is not given does nothing at that one's value.
    neutral = {
        name: float(found[spec.optional]["value"]) if spec.optional else spec.neutral
        for name in names & found.keys()
        for spec in [effect.spec(name)]
    }
    return any(_away(found[name], value) for name, value in neutral.items())


def _gives(fitted: Model, proposal: Proposal) -> bool:
    """Whether the interval of what a spring gives, one over its stiffness, leaves out 0; True where nothing says."""
    # To first order it is as wide, beside its middle, as the stiffness's.
    return _away(effect_parameters(fitted, proposal.name)[proposal.effect.parameters[0].name], 0.0)


def _away(fit: dict[str, Any], neutral: float) -> bool:
    """Whether a value is away from another by more than its interval, or nothing says how sure it is."""
    error = fit["stderr"]
    if error is None or not math.isfinite(error):
        return True
    return abs(float(fit["value"]) - neutral) > _HALF_WIDTH * float(error)
