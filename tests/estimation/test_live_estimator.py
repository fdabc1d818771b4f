from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.estimation.live_estimator import RecursiveEstimator
from idloop.physics import Model, load_model
from idloop.records import Record

Make = Callable[..., Record]
WRONG = {"drive.gain": 5.0, "motor.viscous_friction": 1.0, "coulomb_friction@motor.level": 0.0}


def test_finds_the_parameters_and_predicts(motor: Model, experiment: Make) -> None:
    record = experiment(motor, samples=5000, seed=1)
    estimator = RecursiveEstimator(motor.with_values(WRONG))
    prediction = estimator.update_block(record.time, record.input, record.output)
    for name in motor.free:
        assert estimator.parameters[name] == pytest.approx(motor.values[name], rel=0.05), name
    late = (prediction - record.output)[-1000:]
    noise = np.array([o.noise for o in motor.outputs])
    assert np.all(np.std(late, axis=0) < 1.3 * noise)
    assert np.all(estimator.stderr < 0.1)
    assert estimator.model.parameter("drive.gain").stderr is not None


@settings(max_examples=10)
@given(st.lists(st.integers(1, 130), min_size=1, max_size=12))
def test_blocks_do_not_change_the_result(motor: Model, experiment: Make, sizes: list[int]) -> None:
    record = experiment(motor, samples=400, seed=2)
    whole, parts = RecursiveEstimator(motor), RecursiveEstimator(motor)
    expected = whole.update_block(record.time, record.input, record.output)
    found, start = [], 0
    while start < 400:
        stop = min(start + sizes[len(found) % len(sizes)], 400)
        found.append(parts.update_block(record.time[start:stop], record.input[start:stop], record.output[start:stop]))
        start = stop
    assert np.array_equal(np.concatenate(found), expected, equal_nan=True)
    assert np.array_equal(parts.theta, whole.theta)


def test_blocks_of_a_stiff_chain_do_not_change_the_result(experiment: Make) -> None:
    chain = load_model("torsion")
    record = experiment(chain, samples=600, seed=2)
    found = []
    for size in (1, 7, 100, 600):
        estimator = RecursiveEstimator(chain, sample_time=0.01, block=100)
        for start in range(0, 600, size):
            part = slice(start, start + size)
            estimator.update_block(record.time[part], record.input[part], record.output[part])
        found.append(estimator.theta)
    for theta in found[1:]:
        assert np.array_equal(theta, found[0])


def test_gap_clock_reset_and_late_samples(motor: Model, experiment: Make) -> None:
    record = experiment(motor, samples=300)
    estimator = RecursiveEstimator(motor)
    estimator.update_block(record.time, record.input, record.output)
    assert (estimator.resets, estimator.late) == (0, 0)
    assert np.all(np.isnan(estimator.update(2.5, 0.0, record.output[0])))
    assert estimator.late == 1
    assert np.all(np.isnan(estimator.update(60.0, 0.0, record.output[0])))
    assert estimator.resets == 1
    assert np.all(np.isfinite(estimator.update(60.01, 0.0, record.output[1])))
    estimator.update(0.0, 0.0, record.output[0])
    assert estimator.resets == 2


def test_epoch_stamps_cost_no_precision(motor: Model, experiment: Make) -> None:
    record = experiment(motor, samples=300)
    start = 2.0**30  # a step of 1/128 s is exact at this size
    time = np.arange(300) / 128.0
    near, far = RecursiveEstimator(motor), RecursiveEstimator(motor)
    a = near.update_block(time, record.input, record.output)
    b = far.update_block(start + time, record.input, record.output)
    assert np.array_equal(a, b, equal_nan=True)


@settings(max_examples=15)
@given(st.integers(0, 1000), st.floats(0.1, 1e6))
def test_garbage_never_breaks_it(motor: Model, seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    n = 400
    y = size * rng.standard_cauchy((n, 2))
    y[rng.random((n, 2)) < 0.2] = np.nan
    u = np.where(rng.random(n) < 0.1, np.nan, size * rng.normal(size=n))
    estimator = RecursiveEstimator(motor)
    estimator.update_block(np.cumsum(rng.exponential(0.01, n)), u, y)
    low, high = motor.bounds
    assert np.all(np.isfinite(estimator.theta))
    assert np.all((estimator.theta >= low) & (estimator.theta <= high))
    assert np.all(np.isfinite(estimator.covariance))


def test_missing_outputs_are_predicted_around(motor: Model, experiment: Make) -> None:
    record = experiment(motor, samples=3000, seed=3)
    output = record.output.copy()
    output[::2, 0] = np.nan
    estimator = RecursiveEstimator(motor.with_values(WRONG))
    estimator.update_block(record.time, record.input, output)
    assert estimator.parameters["drive.gain"] == pytest.approx(motor.values["drive.gain"], rel=0.05)


@pytest.mark.filterwarnings("error")
def test_an_infinite_reading_counts_as_missing(motor: Model, experiment: Make) -> None:
    record = experiment(motor, samples=600)
    spoilt, missing = record.output.copy(), record.output.copy()
    spoilt[100], spoilt[200:220, 1] = np.inf, -np.inf
    missing[100], missing[200:220, 1] = np.nan, np.nan
    one, other = RecursiveEstimator(motor), RecursiveEstimator(motor)
    predicted = one.update_block(record.time, record.input, spoilt)
    assert np.array_equal(predicted, other.update_block(record.time, record.input, missing), equal_nan=True)
    assert one.resets == 0
    assert np.isinf(spoilt[100]).all(), "the caller's data stay"


def test_set_model_continues_without_a_jump(motor: Model, experiment: Make) -> None:
    record = experiment(motor, samples=1200, seed=4)
    estimator = RecursiveEstimator(motor, adapt=False)
    estimator.update_block(record.time[:600], record.input[:600], record.output[:600])
    estimator.set_model(motor.with_values({"drive.gain": 8.3}))
    assert estimator.parameters["drive.gain"] == 8.3
    after = estimator.update_block(record.time[600:], record.input[600:], record.output[600:])
    noise = np.array([o.noise for o in motor.outputs])
    assert np.all(np.abs(after - record.output[600:]) < 8.0 * noise)
    assert estimator.resets == 0
    with pytest.raises(InputError, match="outputs"):
        estimator.set_model(load_model("torsion"))


def test_fixed_parameters_stay(motor: Model, experiment: Make) -> None:
    record = experiment(motor, samples=500)
    estimator = RecursiveEstimator(motor.with_values(WRONG), adapt=False)
    estimator.update_block(record.time, record.input, record.output)
    assert estimator.parameters == pytest.approx(WRONG)


def test_bad_settings(motor: Model) -> None:
    with pytest.raises(InputError, match="must be positive"):
        RecursiveEstimator(motor, block=0)
