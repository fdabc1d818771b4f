"""The joint filter: right with the right noises, biased with wrong ones, and never lost."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.polynomial import Orders, Polynomials
from idloop.estimation.recursive import ExtendedKalman, extended_kalman_filter, recursive_arx, track
from idloop.estimation.recursive.extended_kalman import start_from, stationary_gain
from idloop.estimation.recursive.step import stable

POLES = [1.0, -1.5, 0.7]
TRUTH = np.array([-1.5, 0.7, 1.0, 0.5])


def follow(data, **options):
    estimator = extended_kalman_filter(2, 2, **options)
    estimator.update_block(data.input, data.output[:, 0])
    return estimator


def sound(estimator):
    assert np.all(np.isfinite(estimator.coefficients))
    assert np.all(np.isfinite(estimator.state))
    assert np.all(np.isfinite(estimator._upper))
    assert np.all(estimator._diagonal >= 0.0)
    values = np.linalg.eigvalsh(estimator.covariance)
    assert values[0] >= -1e-12 * max(values[-1], 1e-300)


@pytest.mark.parametrize("known", [{}, {"process_noise": 0.0, "measurement_noise": 1e-3}])
def test_without_noise_the_coefficients_are_the_plants(made, known):
    estimator = follow(made(2000, noise=0.0, f=POLES), **known)
    np.testing.assert_allclose(estimator.coefficients, TRUTH, atol=1e-4)
    assert estimator.projections == 0


def test_noise_of_the_output_does_no_harm_where_its_size_is_known(made):
    def off(samples):
        found = [follow(made(samples, i, f=POLES), process_noise=0.0, measurement_noise=0.5) for i in range(10)]
        return np.array([one.coefficients - TRUTH for one in found]), np.array([one.stderr for one in found])

    few, _ = off(1000)
    many, stderr = off(16000)
    assert np.sqrt(np.mean(many**2)) < np.sqrt(np.mean(few**2)) / 2.5
    # Standard errors that hold: too small ones and too large ones would both show.
    assert 0.4 < np.sqrt(np.mean((many / stderr) ** 2)) < 1.6


@pytest.mark.slow
def test_a_high_order_starts_within_the_circle():
    rng = np.random.default_rng(0)
    u = rng.normal(size=1500)
    y = np.convolve(u, 0.9 ** np.arange(1, 50))[:1500] + 0.1 * rng.normal(size=1500)
    estimator = extended_kalman_filter(20, 20)
    estimator.update_block(u, np.concatenate([[0.0], y[:-1]]))
    assert estimator.projections < 0.5 * estimator.samples
    assert stable(estimator.coefficients[:20], 1.0101)


def test_wrong_noises_bias_it_as_theory_says(made):
    def off(**noises):
        found = [follow(made(8000, i, f=POLES), **noises).coefficients - TRUTH for i in range(6)]
        return np.max(np.abs(np.mean(found, axis=0)))

    # All of the noise in the equation, as least squares has it.
    assert off(process_noise=0.5, measurement_noise=1e-3) > 10.0 * off(process_noise=0.0, measurement_noise=0.5)


def test_noise_in_the_equation_alone_makes_it_least_squares(made):
    data = made(2000, a=POLES)
    plain = recursive_arx(2, 2)
    plain.update_block(data.input, data.output[:, 0])
    estimator = follow(data, process_noise=0.5, measurement_noise=1e-3)
    assert np.all(np.abs(estimator.coefficients - plain.coefficients) < plain.stderr)
    np.testing.assert_allclose(estimator.stderr, plain.stderr, rtol=0.2)
    assert estimator.innovation_variance == pytest.approx(0.25, rel=0.1)


def test_the_first_samples_tell_which_noise_it_is(made):
    for system, process, measurement in (({"a": POLES}, 0.5, 0.0), ({"f": POLES}, 0.0, 0.5)):
        for seed in range(6):
            believed = follow(made(1000, seed, **system))
            assert believed.process_noise[0] == pytest.approx(process, abs=0.12)
            assert believed.measurement_noise == pytest.approx(measurement, abs=0.12)


def test_noises_that_it_finds_itself_serve_as_well_as_those_that_are_known(made):
    def off(**noises):
        found = [follow(made(16000, i, f=POLES), **noises).coefficients - TRUTH for i in range(6)]
        return np.sqrt(np.mean(np.square(found)))

    assert off() < 1.3 * off(process_noise=0.0, measurement_noise=0.5)


def test_least_squares_on_the_first_samples_is_a_start(made):
    orders = Orders(2, (2,), 0, 0, (0,), (1,))
    data = made(20000, f=POLES)
    told = start_from(data.input, data.output[:, 0], orders)
    np.testing.assert_allclose(told.vector, TRUTH, atol=0.05)
    assert told.measurement == pytest.approx(0.25, rel=0.1)
    assert start_from(data.input[:15], data.output[:15, 0], orders) is None


def test_delays_inputs_and_feedthrough_stand_where_they_belong():
    rng = np.random.default_rng(3)
    u, y = rng.normal(size=(2000, 2)), np.zeros(2000)
    for t in range(2000):
        y[t] = u[t, 0] + (0.8 * y[t - 1] if t else 0.0) + (2.0 * u[t - 3, 1] if t > 2 else 0.0)
    estimator = extended_kalman_filter(1, (1, 1), (0, 3), input_names=("u", "v"))
    estimator.update_block(u, y)
    assert estimator.names == ("a1", "b0[u]", "b3[v]")
    np.testing.assert_allclose(estimator.coefficients, [-0.8, 1.0, 2.0], atol=1e-4)


def test_an_integrator_is_followed():
    rng = np.random.default_rng(4)
    u = rng.choice([-1.0, 1.0], 3000)
    y = np.concatenate([[0.0], 0.01 * np.cumsum(u)[:-1]])
    estimator = extended_kalman_filter(1, 1, measurement_noise=0.01)
    estimator.update_block(u, y + 0.01 * rng.normal(size=3000))
    np.testing.assert_allclose(estimator.coefficients, [-1.0, 0.01], atol=0.002)


@pytest.mark.slow
@given(cut=st.lists(st.integers(1, 120), min_size=1, max_size=6))
def test_sample_by_sample_is_block_by_block(made, cut):
    data = made(500, f=POLES)
    whole, parts = (extended_kalman_filter(2, 2, forgetting=0.99) for _ in range(2))
    expected = whole.update_block(data.input, data.output[:, 0])
    edges = np.unique(np.clip(np.cumsum([0, *cut, 500]), 0, 500))
    found = [parts.update_block(data.input[a:b], data.output[a:b, 0]) for a, b in pairwise(edges)]
    np.testing.assert_array_equal(np.concatenate(found), expected)
    np.testing.assert_array_equal(parts.coefficients, whole.coefficients)


numbers = st.floats(-1e6, 1e6) | st.just(float("nan")) | st.sampled_from([0.0, 1.0, -1.0])


@pytest.mark.slow
@given(
    pattern=st.lists(st.tuples(numbers, numbers), min_size=1, max_size=40),
    order=st.integers(1, 4),
    forgetting=st.sampled_from([1.0, 0.99, 0.9]),
    seed=st.integers(0, 100),
)
def test_the_covariance_stays_positive_whatever_comes(pattern, order, forgetting, seed):
    estimator = extended_kalman_filter(order, order, forgetting=forgetting)
    rows = np.tile(np.array(pattern), (600 // len(pattern) + 1, 1))
    estimator.update_block(rows[:, 0], rows[:, 1])
    sound(estimator)
    rng = np.random.default_rng(seed)
    estimator.update_block(rng.normal(size=50), 1e3 * rng.normal(size=50))
    sound(estimator)
    assert stable(estimator.coefficients[:order], 1.0101)


def test_missing_samples_and_new_experiments_teach_nothing_and_harm_nothing(made):
    data = made(3000, 0, f=POLES)
    y, u = data.output[:, 0].copy(), data.input.copy()
    y[20:40], y[700:1700], u[2000:2003] = np.nan, np.nan, np.nan
    estimator = extended_kalman_filter(2, 2, process_noise=0.0, measurement_noise=0.5)
    innovations = estimator.update_block(u, y)
    np.testing.assert_array_equal(np.isnan(innovations), np.isnan(y))
    assert estimator.samples == 1980
    np.testing.assert_allclose(estimator.coefficients, TRUTH, atol=0.1)
    before = estimator.coefficients
    estimator.update(float("nan"), float("nan"))
    np.testing.assert_array_equal(estimator.coefficients, before)
    estimator.forget_signals()
    np.testing.assert_array_equal(estimator.state, 0.0)
    assert estimator.update(0.0, 0.0) == 0.0
    sound(estimator)


@pytest.mark.slow
@given(st.floats(-8, 8), st.floats(-8, 8))
def test_units_change_nothing(made, command, measurement):
    k, g = 10.0**command, 10.0**measurement
    data = made(400, f=POLES)
    plain, moved = follow(data), extended_kalman_filter(2, 2)
    moved.update_block(k * data.input, g * data.output[:, 0])
    unit = np.array([1.0, 1.0, g / k, g / k])
    np.testing.assert_allclose(moved.coefficients, unit * plain.coefficients, rtol=1e-6)
    np.testing.assert_allclose(moved.stderr, unit * plain.stderr, rtol=1e-5)


def test_coefficients_that_move_are_followed():
    rng = np.random.default_rng(1)
    u = rng.normal(size=4000)
    gain = np.where(np.arange(4000) < 2000, 1.0, 2.0)
    y = np.zeros(4000)
    for t in range(1, 4000):
        y[t] = 0.5 * y[t - 1] + gain[t] * u[t - 1]
    y += 0.1 * rng.normal(size=4000)
    for options in ({"drift": 1e-3}, {"random_walk": [0.0, 0.01]}, {"forgetting": 0.99}):
        estimator = extended_kalman_filter(1, 1, **options)
        estimator.update_block(u, y)
        assert estimator.coefficients[1] == pytest.approx(2.0, abs=0.1)


def test_the_stationary_gain_solves_the_riccati_equation():
    a, noise, measurement = np.array([-1.5, 0.7]), np.array([0.3, 0.1]), 0.5
    forward = np.column_stack([-a, [1.0, 0.0]])
    h = np.array([[1.0], [0.0]])
    p = solve_discrete_are(forward.T, h, np.diag(noise), np.array([[measurement]]))
    np.testing.assert_allclose(stationary_gain(a, noise, measurement), forward @ p[:, 0] / (p[0, 0] + measurement))


def test_the_model_predicts_as_the_filter_does(made):
    data = made(4000, f=POLES, noise=0.5)
    noisy = SampledData("record", data.input, data.output, 0.1, ("u",), ("V",), ("y",), ("rad",))
    history = track(extended_kalman_filter(2, 2, sample_time=0.1, input_names=("u",)), noisy, every=10)
    assert history.names == ("a1", "a2", "b1[u]", "b2[u]")
    assert history.values.shape == history.stderr.shape == (400, 4)
    assert history.final.names == ("a1", "a2", "b1[u]", "b2[u]", "c1", "c2")
    left = history.final.model().innovations(
        SampledData("late", noisy.input[3000:], noisy.output[3000:], 0.1, ("u",), ("V",), ("y",), ("rad",))
    )
    assert np.std(left[50:]) == pytest.approx(np.std(history.innovations[3050:]), rel=0.05)
    again = ExtendedKalman(Orders(2, (2,), 0, 0, (0,), (1,)), start=history.final)
    np.testing.assert_array_equal(again.coefficients, history.final.vector[:4])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ExtendedKalman(Orders(1, (1,), 1, 0, (0,), (1,))), "A and B only"),
        (lambda: extended_kalman_filter(2, 2, process_noise=[1.0, 2.0, 3.0]), "one per state"),
        (lambda: extended_kalman_filter(2, 2, process_noise=-1.0), "0 or more"),
        (lambda: extended_kalman_filter(2, 2, measurement_noise=0.0), "above 0"),
        (lambda: extended_kalman_filter(2, 2, radius=3.0), "radius"),
        (lambda: extended_kalman_filter(2, 2, drift=-1.0), "drift"),
        (
            lambda: extended_kalman_filter(
                1, 1, start=Polynomials.from_vector(
                    Orders(2, (1,), 0, 0, (0,), (1,)), np.zeros(3), sample_time=1.0, input_names=("u",),
                    output_name="y",
                ),
            ),
            "has the orders",
        ),
    ],
)  # fmt: skip
def test_wrong_use_is_one_line(call, message):
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
