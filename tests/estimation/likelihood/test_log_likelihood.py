"""Log-likelihood of the first instants: a constant force beside a random-walk disturbance."""

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.conftest import RATE

from idloop.diagnosis import diagnose
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.log_likelihood import weigh
from idloop.estimation.likelihood.refit import refit
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record


def beside_a_walk(load: float, size: float, seed: int) -> Record:
    """Position of an axis under random steps, a constant load and a walk of a given size at the end."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 1.0 / RATE)
    command = rng.normal(size=81)[(4 * time).astype(int)]
    walk = np.cumsum(rng.normal(size=len(time))) * size / np.sqrt(len(time))
    position = simulate(load_model("axis"), time, command + load + walk, time).output[:, 0]
    # Noise with a memory of a few samples, for which the whitening needs lags.
    noise = 5e-4 * np.convolve(rng.normal(size=len(time) + 4), [0.6, 0.5, 0.4, 0.3, 0.3], "valid")
    return Record("run", time, command, time, (position + noise)[:, None], "u", "N·m", ("axis.position",), ("rad",))


@pytest.fixture(scope="module")
def one_sensor(start: Model) -> Model:
    return replace(start, outputs=start.outputs[:1])


@pytest.mark.slow
@pytest.mark.parametrize(("load", "seed"), [(0.15, 1), (-0.15, 2), (0.0, 3), (0.0, 4)])
def test_a_constant_far_above_what_a_walk_begins_with_is_named(one_sensor: Model, load: float, seed: int) -> None:
    found = diagnose(one_sensor, [beside_a_walk(load, 0.01, seed)])
    assert set(found.set) == ({"input_offset@input", "load_torque@axis"} if load else set())
    if found.best is not None:
        value = next(iter(found.best.parameters.values()))
        assert abs(value["value"] - load) < 3.0 * value["stderr"] < 0.1


def test_the_first_instants_show_a_missing_constant_force(one_sensor: Model) -> None:
    estimation = prepare_estimation(one_sensor, [beside_a_walk(0.15, 0.01, 1)], "prediction")
    without = refit(estimation, one_sensor)
    beside = refit(estimation, one_sensor.with_effects(["load_torque@axis(torque=0.15)"]), None, without)
    assert any(without.problem.orders)
    assert beside.initial_log_likelihood - without.initial_log_likelihood > 10.0
    # Without whitening no instant is spent on a past, and the likelihood says all.
    weigh(without.problem, without.point, [0] * len(without.problem.orders))
    assert replace(without).initial_log_likelihood == 0.0
