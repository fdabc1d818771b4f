"""Friction with a memory: bristles that are at their end need no steps of their own."""

import numpy as np
import pytest

from idloop.physics import load_model, simulate
from idloop.physics.kernel import RATE, rate_along
from idloop.physics.layout import lay_out


@pytest.mark.parametrize("stiffness", [1e3, 1e5])
def test_stiff_bristles_in_fast_motion_take_few_steps_and_lose_no_accuracy(stiffness: float) -> None:
    bristles = f"presliding_friction@axis(level=0.2,static=0.3,velocity=0.1,stiffness={stiffness})"
    model = load_model("axis").with_effects([bristles])
    axis = lay_out(model, model.values).axis
    assert rate_along.py_func(axis.spatial_rate[0], 1e6) <= 2.0 * axis.constants[RATE]
    time = np.arange(0.0, 4.0, 1e-3)
    command = np.interp(time, np.arange(0.0, 4.2, 0.2), np.random.default_rng(1).uniform(-1.0, 1.0, 21))
    found = simulate(model, time, command, time).output
    # Readings in between bound the steps from above.
    often = np.arange(0.0, time[-1] + 1e-9, 2e-5)
    reference = simulate(model, time, command, often).output[::50][: len(time)]
    np.testing.assert_allclose(found, reference, atol=2e-4 * np.ptp(reference, axis=0).max())
