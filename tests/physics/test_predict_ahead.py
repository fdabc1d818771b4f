import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimation.dataset import Data, prepare
from idloop.physics import load_model, simulate
from idloop.physics.engine import Engine
from idloop.records import Record

TIME = np.arange(0.0, 2.0, 0.01)
MODEL = load_model("dc_motor").with_effects(
    ["coulomb_friction@motor(level=1)", "sensor_delay@position[motor](delay=0.013)"]
)
GAIN = np.array([[0.3, 0.001], [0.5, 0.2], [0.4, 0.1]])


def data_of(noise: float = 0.0):
    command = 4.0 * np.sign(np.sin(5.0 * TIME))
    output = simulate(MODEL, TIME, command, TIME).output
    output = output + noise * np.random.default_rng(0).normal(size=output.shape)
    units = tuple(o.unit for o in MODEL.outputs)
    record = Record("r", TIME, command, TIME, output, MODEL.input.name, "V", MODEL.output_names, units)
    return prepare(MODEL, [record])[0]


def test_one_step_ahead_is_the_one_step_prediction() -> None:
    engine, data = Engine(MODEL), data_of(0.01)
    data.output[50:60, 1] = np.nan
    start = engine.initial_state()
    ahead = steps_ahead(engine, data, 1)
    innovation = engine.predict(None, data.input_time, data.input, data.time, data.output, GAIN, initial_state=start)
    known = np.isfinite(innovation)
    known[0] = False
    np.testing.assert_allclose(ahead[known], (data.output - innovation)[known], atol=1e-12)


def steps_ahead(engine: Engine, data: Data, steps: int) -> np.ndarray:
    start = engine.initial_state()
    return engine.predict_ahead(None, data.input_time, data.input, data.time, data.output, GAIN, steps, start)


@pytest.mark.parametrize("steps", (1, 7, 40))
def test_the_true_model_sees_the_future(steps: int) -> None:
    engine, data = Engine(MODEL), data_of()
    ahead = steps_ahead(engine, data, steps)
    assert np.all(np.isnan(ahead[:steps]))
    np.testing.assert_allclose(ahead[steps:], data.output[steps:], atol=1e-9)


def test_measurements_after_the_start_of_the_look_ahead_do_not_count() -> None:
    engine, data = Engine(MODEL), data_of(0.01)
    before = steps_ahead(engine, data, 20)
    data.output[101:] += 1.0
    after = steps_ahead(engine, data, 20)
    np.testing.assert_array_equal(before[20:121], after[20:121])
    assert np.all(before[121] != after[121])


@pytest.mark.parametrize("steps", (0, len(TIME)))
def test_horizons_that_do_not_fit(steps: int) -> None:
    engine, data = Engine(MODEL), data_of()
    with pytest.raises(InputError, match="steps ahead"):
        steps_ahead(engine, data, steps)
