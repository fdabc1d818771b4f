"""Standard errors of undisturbed data."""

import numpy as np
import pytest
from tests.diagnosis.conftest import record_of

from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import refit
from idloop.physics import load_model


@pytest.mark.slow
def test_undisturbed_intervals_are_as_wide_as_the_estimates_scatter() -> None:
    model = load_model("axis").with_effects(["dead_zone@input(width=0.1)"])
    scores = []
    for seed in range(30):
        estimation = prepare_estimation(model, [record_of(model, seed, seconds=4.0)], "prediction")
        fitted = refit(estimation, model).with_stderr()
        scores += [(p.value - model.values[p.name]) / p.stderr for p in fitted.parameters if p.free and p.stderr]
    assert len(scores) == 30 * len(model.free)
    # One where the intervals are right; with a column for a disturbance that is not there they were half as wide again.
    assert 0.6 < float(np.sqrt(np.mean(np.square(scores)))) < 1.25
