"""Whether the measured motion follows the command at all.

In a record of two runs, of a drive that was off, or of a motor that was turned by hand, a fit finds a machine so heavy
or so stiff that the command has no influence, and effects that remove the rest of it as improvements. Such records are
recognised by predictions that are no better with the command than with its mean. A model that lacks the effect through
which the command acts predicts no better either, but the model with that effect does; so does one with the command
reversed, where command and motion count in opposite directions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import Enum

import numpy as np

from idloop.diagnosis.screening.granger_test import granger_causes
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data
from idloop.estimation.direction import OPPOSITE_DIRECTION, REVERSE_ADVICE, gain_is_turned
from idloop.estimation.force_balance.window_width import fit_by_force_if_possible
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.likelihood.likelihood_difference import distinguishable
from idloop.estimation.likelihood.refit import Refit, refit, refit_or_none, transfer
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics.model import Model
from idloop.records import Record
from idloop.validation.free_run import free_run


class CommandResponse(str, Enum):
    """How the measured motion follows the command; the values are those of the JSON."""

    FOLLOWS = "follows"
    UNMOVED = "unmoved"
    OTHERWISE = "otherwise"
    REVERSED = "reversed"

    @property
    def uninformative(self) -> bool:
        """Whether such data contain no information about the axis."""
        return self in (CommandResponse.UNMOVED, CommandResponse.REVERSED)

    @property
    def text(self) -> str:
        """Finding for the user; empty where the motion follows the command."""
        return _SENTENCES[self]


_SENTENCES = {
    CommandResponse.FOLLOWS: "",
    CommandResponse.UNMOVED: (
        "the measured motion does not follow the command: the model predicts it no better with the command than "
        "without. Was the drive on, and are command and motion of the same run and the same joint?"
    ),
    CommandResponse.OTHERWISE: (
        "the measured motion follows the command, but not as this model has it: the model predicts it no better with "
        "the command than without. What lies between the two is missing, or the values of the model file are far from "
        "the machine's"
    ),
    CommandResponse.REVERSED: (
        f"{OPPOSITE_DIRECTION}: with the sign of the command turned the model predicts it. {REVERSE_ADVICE}"
    ),
}


def responds_to_command(estimation: EstimationProblem, fit: Refit) -> bool:
    """Whether a fitted model predicts the motion better with the command than without, or that cannot be computed.

    Or whether its free run is far better with it: one sample ahead, late stamps hide what the command does.
    """
    # Of steps from rest, each a constant command, the mean of its own would be the command itself.
    means = [float(np.mean(one.input)) for one in estimation.data]
    if all(np.ptp(one.input) == 0.0 for one in estimation.data):
        # A step of one level began from zero.
        means = [float(np.mean(means)) if np.ptp(means) > 0.0 else 0.0] * len(means)
    still = tuple(
        replace(one, input=np.full_like(one.input, mean)) for one, mean in zip(estimation.data, means, strict=True)
    )
    without = transfer(replace(estimation, data=still), fit, own_disturbance=True)
    return without is None or distinguishable(fit, without) or _runs_by_command(estimation.data, still, fit.model)


@np.errstate(over="ignore", invalid="ignore")
def _runs_by_command(data: Sequence[Data], still: Sequence[Data], model: Model) -> bool:
    """Whether the free run of every output misses less than half as much with the command as without."""
    engine = CachingEngine(model)
    try:
        return all(
            np.nanmean((one.output - free_run(engine, one)) ** 2, axis=0)[measured]
            < 0.25 * np.nanmean((one.output - free_run(engine, other)) ** 2, axis=0)[measured]
            for one, other in zip(data, still, strict=True)
            for measured in np.flatnonzero(np.any(np.isfinite(one.output), axis=0))
        )
    except IdloopError:
        return False


def responds_to_reversed_command(estimation: EstimationProblem, fit: Refit, start: Model) -> bool:
    """Whether a model that does not respond to the command responds to its negative; the fit begins at `start`."""
    records = [replace(one, input=-one.input) for one in estimation.records]
    turned = prepare_estimation(start, records, estimation.kind)
    other = refit_or_none(turned, start)
    # A gain that turns with the command is the same model again.
    if other is None or gain_is_turned(start, other.model):
        return False
    return other.log_likelihood > fit.log_likelihood and responds_to_command(turned, other)


def missing_response(estimation: EstimationProblem, fit: Refit, start: Model, seed: int = 0) -> CommandResponse:
    """How the motion follows the command where a fitted model does not respond to it."""
    if responds_to_reversed_command(estimation, fit, start):
        return CommandResponse.REVERSED
    # A command that is constant in every record precedes nothing: steps show their effect from record to record.
    if all(np.ptp(one.input) == 0.0 for one in estimation.records) or granger_causes(estimation.records, seed):
        return CommandResponse.OTHERWISE
    # A stiff loop has the friction of a motion in its command, not before it.
    balance = fit_by_force_if_possible(CachingEngine(start), estimation.data, start.theta)
    moved = balance is not None and balance.explains_force
    return CommandResponse.OTHERWISE if moved else CommandResponse.UNMOVED


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def command_response(start: Model, records: Sequence[Record]) -> CommandResponse:
    """How the motion of some records follows the command, by a model that is not fitted yet.

    It counts as following where that cannot be computed, and in whatever way it follows.
    """
    try:
        estimation = prepare_estimation(start, records, "prediction")
        found = refit(estimation, start)
        if responds_to_command(estimation, found):
            return CommandResponse.FOLLOWS
        response = missing_response(estimation, found, start)
    except (IdloopError, np.linalg.LinAlgError):
        return CommandResponse.FOLLOWS
    return CommandResponse.FOLLOWS if response is CommandResponse.OTHERWISE else response
