"""Options of a diagnosis: the criterion, the error rate, and the improvement that an effect has to make."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from idloop.errors import InputError
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.statistics.whitening import Whitener
from idloop.physics.model import Model
from idloop.records import Record

PREDICTION, SIMULATION, FORCE = "prediction", "simulation", "force"

# An effect that reduces the errors on unseen samples by less than this part has no practical significance.
MINIMUM_IMPROVEMENT = 0.01

Progress = Callable[[float, str], None]


def silent(share: float, text: str) -> None:
    """Report no progress."""


@dataclass(frozen=True)
class Options:
    """What a diagnosis is asked for; an `InputError` for numbers out of range."""

    level: float = 0.01  # family-wise error rate
    minimum_improvement: float = MINIMUM_IMPROVEMENT  # least part by which an effect reduces errors on unseen samples
    effects: Sequence[str] | None = None  # to choose from; None for the whole catalogue
    seed: int = 0  # of the sketches and restarts
    report: Progress = silent

    def __post_init__(self) -> None:
        if not 0.0 < self.level < 0.5:
            raise InputError(f"level = {self.level} is no error rate; choose something such as 0.01")
        if not 0.0 <= self.minimum_improvement < 1.0:
            raise InputError(
                f"minimum_improvement = {self.minimum_improvement} is no part of an error; choose something such as"
                " 0.01"
            )

    def within(self, begin: float, end: float) -> Options:
        """The same for a part of the work, from one share of the whole to another."""
        return replace(self, report=lambda share, text: self.report(begin + (end - begin) * share, text))


def errors_of(criterion: str) -> str:
    """Errors that models are measured by where no force balance decides: prediction or simulation."""
    if criterion not in ("auto", PREDICTION, SIMULATION, FORCE):
        raise InputError(f"criterion {criterion!r} is unknown; choose auto, {PREDICTION}, {SIMULATION}, {FORCE}")
    return SIMULATION if criterion == SIMULATION else PREDICTION


def held_out_problem(
    estimation: EstimationProblem, start: Model, validation: Sequence[Record], kind: str
) -> EstimationProblem | None:
    """The held-out records, whitened as those that are fitted; None where there are none."""
    if not validation:
        return None
    held_out = prepare_estimation(start, validation, kind, estimation.records)
    return replace(held_out, whiteners=estimation.whiteners)


def diagnosis_problem(
    start: Model, records: Sequence[Record], kind: str, companions: Sequence[Record] = ()
) -> EstimationProblem:
    """An estimation problem of a diagnosis: that of free runs without whitening, others with each model's own.

    Free-run errors are model error throughout: a noise model must not absorb them, and their serial correlation is
    accounted for in the evidence.
    """
    estimation = prepare_estimation(start, records, kind, companions)
    if kind != SIMULATION:
        return estimation
    whiteners = tuple(Whitener(np.zeros((0, n, n))) for n in map(len, estimation.groups))
    return replace(estimation, whiteners=whiteners)
