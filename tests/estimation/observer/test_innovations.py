"""Innovations under a disturbance of finite memory."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.linalg import expm

from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.physics import Engine, load_model, simulate
from idloop.physics.engine import Linear
from idloop.records import Record

STEP = 0.01
TIME = STEP * np.arange(150)
COMMAND = np.sign(np.sin(9.0 * TIME)) + 0.3 * np.sin(31.0 * TIME)
GAIN = np.array([[0.3, 0.05], [0.4, 0.3], [2.0, 20.0]])


@pytest.fixture(scope="module")
def engine() -> Engine:
    return Engine(load_model("dc_motor"))


@pytest.fixture(scope="module")
def loaded() -> np.ndarray:
    """Motion of the motor with a load that the model does not know."""
    truth = load_model("dc_motor").with_effect("load_torque", "motor", torque=0.5)
    return simulate(truth, TIME, COMMAND, TIME).output


def recursion(linear: Linear, measured: np.ndarray, decay: float) -> np.ndarray:
    """Innovations of the linear predictor, with the disturbance force and the command as further states."""
    n = len(linear.A)
    rates = np.zeros((n + 2, n + 2))
    rates[:n, :n], rates[:n, n], rates[:n, n + 1] = linear.A, linear.G, linear.B
    transition = expm(STEP * rates)
    transition[n, n] = decay
    state, found = np.zeros(n + 2), []
    for command, reading in zip(COMMAND, measured, strict=True):
        found.append(reading - linear.C @ state[:n])
        state[: n + 1] += GAIN @ np.nan_to_num(found[-1])
        state[n + 1] = command
        state = transition @ state
    return np.array(found)


@example(decay=1.0, missing=0)
@example(decay=0.0, missing=0)
@given(decay=st.floats(0.0, 1.0), missing=st.integers(0, 1))
def test_innovations_are_those_of_the_linear_recursion(
    engine: Engine, loaded: np.ndarray, decay: float, missing: int
) -> None:
    measured = loaded.copy()
    measured[40:60, missing] = np.nan
    seen = engine.predict(None, TIME, COMMAND, TIME, measured, GAIN, decay=decay)
    np.testing.assert_allclose(seen, recursion(engine.linearise(), measured, decay), atol=1e-7)


def test_the_default_disturbance_is_a_random_walk(engine: Engine, loaded: np.ndarray) -> None:
    default = engine.predict(None, TIME, COMMAND, TIME, loaded, GAIN)
    np.testing.assert_array_equal(default, engine.predict(None, TIME, COMMAND, TIME, loaded, GAIN, decay=1.0))
    forgetful = engine.predict(None, TIME, COMMAND, TIME, loaded, GAIN, decay=0.5)
    # Only what is remembered can take a standing load away.
    assert np.abs(default[-20:]).max() < 0.01 * np.abs(forgetful[-20:, 1]).min()


def test_a_white_disturbance_acts_for_one_sample(engine: Engine) -> None:
    measured = np.full((len(TIME), 2), np.nan)
    measured[10, 1], measured[50, 1] = 1.0, 0.0
    push_only = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 20.0]])
    seen = engine.predict(None, TIME, 0.0 * TIME, TIME, measured, push_only, decay=0.0)
    # Velocity that a force of 20 on inertia 1 gives in one sample, then slowed by viscous friction alone.
    friction = 2.306
    reached = 20.0 / friction * (1.0 - np.exp(-friction * STEP))
    assert seen[10, 1] == 1.0
    assert -seen[50, 1] == pytest.approx(reached * np.exp(-friction * 39 * STEP), rel=1e-6)


def records(lengths: list[int], gap: int | None = None) -> list[Record]:
    """Records of the motor; after sample ``gap`` the recorder was away for a while."""
    found = []
    for length in lengths:
        time = STEP * np.arange(length)
        if gap is not None:
            time[gap:] += 1.0
        command = np.sign(np.sin(0.9 * time))
        model = load_model("dc_motor")
        output = simulate(model, time, command, time).output
        names, units = tuple(o.name for o in model.outputs), tuple(o.unit for o in model.outputs)
        found.append(Record("run", time, command, time, output, "motor.effort", "V", names, units))
    return found


def criterion(lengths: list[int], gap: int | None = None) -> InnovationCriterion:
    estimation = prepare_estimation(load_model("dc_motor"), records(lengths, gap), "prediction")
    made = estimation.criterion(load_model("dc_motor"))
    assert isinstance(made, InnovationCriterion)
    return made


def test_a_subset_is_the_middle_of_each_record() -> None:
    whole = criterion([8000, 4000], gap=3900)
    short = whole.subset(3000)
    assert short is not None
    assert [len(d.time) for d in short.data] == [2000, 1000]
    assert [d.time[0] for d in short.data] == [whole.data[0].time[3000], whole.data[1].time[1500]]
    assert [list(d.gaps) for d in short.data] == [[900], []]
    # the disturbance is measured in the same unit, and the whole is left alone
    assert short.intensity == whole.intensity
    assert [len(d.time) for d in whole.data] == [8000, 4000]


def test_short_records_have_no_subset() -> None:
    assert criterion([3000]).subset(2000) is None
