"""Choice of the criterion where prediction and free run differ."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from idloop.estimation.criterion_choice import choose_criterion

NAMES = ("motor.viscous_friction", "drive.gain")


def fitted(values, stderr, error=0.01, converged=True):
    residual = SimpleNamespace(value=np.full((100, 1), error))
    return SimpleNamespace(
        names=NAMES,
        values=np.array(values),
        stderr=np.array(stderr),
        residuals=(residual,),
        converged=converged,
        why="w",
    )


DATA = [SimpleNamespace(output=np.linspace(-1.0, 1.0, 100)[:, None])]


@pytest.mark.parametrize(
    ("prediction", "simulation", "chosen"),
    [
        (fitted([2.0, 8.0], [0.1, 0.1]), fitted([2.0, 8.0], [0.1, 0.1]), "prediction"),
        (fitted([2.0, 8.0], [2.0, 2.0]), fitted([2.0, 8.0], [0.1, 0.1]), "simulation"),
        # A gain that may be nothing has not been seen, although the free run tells only its ratio to the friction.
        (fitted([84.0, -24.0], [6.0, 150.0]), fitted([21000.0, 20000.0], [np.nan, np.nan]), "simulation"),
        (fitted([84.0, -24.0], [6.0, 150.0]), fitted([21000.0, 20000.0], [np.nan, np.nan], error=1.0), "prediction"),
        (fitted([84.0, -24.0], [6.0, 150.0]), fitted([2.0, 8.0], [np.nan, np.nan], converged=False), "prediction"),
        # Small values with small errors: a disturbance has taken most of the drive's force over.
        (fitted([4.0, 0.12], [1.9, 0.05]), fitted([24.6, 0.68], [1.3, 0.04]), "simulation"),
        # A friction that may be nothing is one.
        (fitted([0.1, 8.0], [0.2, 0.1]), fitted([0.1, 8.0], [0.2, 0.1]), "prediction"),
    ],
)
def test_the_free_run_answers_where_prediction_is_blind(prediction, simulation, chosen):
    choice = choose_criterion(prediction, simulation, DATA, prediction.residuals)
    assert choice.criterion == chosen
    if np.isnan(simulation.stderr).any() and chosen == "simulation":
        assert "cannot tell drive.gain" in choice.why


@pytest.mark.parametrize(("missed", "chosen"), [(0.05, "prediction"), (0.2, "simulation")])
def test_values_whose_free_run_is_far_worse_than_the_best_are_not_used(missed, chosen):
    prediction, simulation = fitted([48.0, 2570.0], [1.0, 55.0]), fitted([160.0, 8446.0], [4.0, 210.0])
    choice = choose_criterion(prediction, simulation, DATA, fitted([], [], error=missed).residuals)
    assert choice.criterion == chosen
    assert chosen == "prediction" or "misses 34 % of the signal, and 1.7 % at best" in choice.why
