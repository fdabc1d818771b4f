"""What a diagnosis may be asked to measure models by, and how sure and how large an effect has to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.errors import InputError
from idloop.estimation.dataset import output_groups
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.statistics.whitening import Whitener

PREDICTION, SIMULATION, FORCE = "prediction", "simulation", "force"

# An effect that makes errors on unseen samples smaller by less than this part is not worth a name.
MINIMUM_IMPROVEMENT = 0.01


def first_kind(criterion: str) -> str:
    """Errors that models are measured by where a force balance does not decide: prediction or simulation."""
    if criterion not in ("auto", PREDICTION, SIMULATION, FORCE):
        raise InputError(f"criterion {criterion!r} is unknown; choose auto, {PREDICTION}, {SIMULATION}, {FORCE}")
    return SIMULATION if criterion == SIMULATION else PREDICTION


def check_numbers(level: float, minimum_improvement: float) -> None:
    """Refuse what is no error rate, or no part of an error."""
    if not 0.0 < level < 0.5:
        raise InputError(f"level = {level} is no error rate; choose something such as 0.01")
    if not 0.0 <= minimum_improvement < 1.0:
        raise InputError(
            f"minimum_improvement = {minimum_improvement} is no part of an error; choose something such as 0.01"
        )


def with_common_whitening(estimation: EstimationProblem) -> EstimationProblem:
    """Give a problem of free runs no whitening at all; others keep each model's own.

    Free-run errors are model error through and through: nothing in them is a noise model's to take, and their serial
    correlation is reckoned with where evidence is weighed.
    """
    if estimation.kind != SIMULATION:
        return estimation
    sizes = [len(group) for group in output_groups(list(estimation.data))]
    return replace(estimation, whiteners=tuple(Whitener(np.zeros((0, n, n))) for n in sizes))
