"""The fast way by correlations against the exact way by windows: the same model, and nobody is refused for it."""

from dataclasses import replace

import numpy as np
import pytest

from idloop.estimation.linear.model import error_covariance
from idloop.estimation.subspace import cva, moesp, n4sid, pbsid
from idloop.estimation.subspace.compression import compress, innovation_sizes, triangular
from idloop.estimation.subspace.model import command_matrices, modal_regression


@pytest.mark.parametrize("method", [n4sid, moesp, cva])
def test_both_ways_give_the_same_model(method, true, made):
    data = [made(true, 1500, 0.3, seed) for seed in range(2)]
    fast, exact = method(data, 3, horizon=10), method(data, 3, horizon=10, exact=True)
    frequency = np.linspace(0.1, 4.0, 20)
    np.testing.assert_allclose(fast.response(frequency), exact.response(frequency), rtol=1e-7, atol=1e-7)
    # Here the first state is the one that suits the outputs in deviations, there in their own units.
    np.testing.assert_allclose(fast.covariance, exact.covariance, rtol=0.01, atol=1e-4)


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("known_gain", [False, True])
def test_modes_carry_the_regression_on_all_rows(true, made, feedthrough, known_gain):
    parts = [made(true, 700, 0.2, seed, start=(1.0, -2.0, 3.0)) for seed in range(3)]
    compression, slow = (compress(parts, 12, exact=exact) for exact in (False, True))
    c = true.c / compression.output_scale[:, None]
    gain = true.gain * compression.output_scale * known_gain
    fit = modal_regression(true.a, c, gain, compression, feedthrough)
    b, d, covariance = command_matrices(slow, true.a, c, gain, feedthrough)
    assert covariance is None
    np.testing.assert_allclose(fit.b, b, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(fit.d, d, rtol=1e-9, atol=1e-10)


def test_the_errors_that_come_out_on_the_way_are_those_of_the_model(true, made):
    data = made(true, 2000, 0.2)
    found = pbsid(data, 3)
    np.testing.assert_allclose(found.covariance, error_covariance(found, [data]), rtol=0.01)


def test_two_commands(made, true):
    data = made(replace_input(true), 2000, 0.2)
    fast, exact = n4sid(data, 3, feedthrough=True), n4sid(data, 3, feedthrough=True, exact=True)
    np.testing.assert_allclose(fast.d, exact.d, atol=1e-8)
    np.testing.assert_allclose(fast.poles, exact.poles, rtol=1e-7)


def replace_input(true):
    true.b = np.hstack([true.b, [[0.1], [0.5], [0.0]]])
    true.d = np.zeros((2, 2))
    return true


def test_parallel_modes_are_left_to_the_rows(made, true):
    compression = compress(made(true, 500, 0.2), 4)
    jordan = np.array([[0.5, 1.0, 0.0], [0.0, 0.5, 1.0], [0.0, 0.0, 0.5]])
    assert modal_regression(jordan, true.c, 0.0 * true.gain, compression, False) is None


def test_a_predictor_that_overflows_is_left_to_the_rows(made, true):
    compression = compress(made(true, 500, 0.2), 4)
    assert modal_regression(np.diag([9.0, 0.5, 0.2]), true.c, 0.0 * true.gain, compression, False) is None


@pytest.mark.parametrize(
    "spoil",
    [
        lambda data, _: data,  # no noise at all
        lambda data, t: replace(data, input=np.sin(0.3 * t)[:, None]),
        lambda data, t: replace(data, output=data.output[:, [0, 0]]),
    ],
)
def test_data_that_squares_cannot_carry_are_factored_themselves(made, true, spoil):
    data = made(true, 1000, 0.0)
    assert not compress(spoil(data, np.arange(1000.0)), 20).squared


def test_a_factor_that_does_not_exist_is_none():
    assert triangular(np.array([[1.0, 2.0], [2.0, 1.0]])) is None
    assert triangular(np.zeros((2, 2))) is None


def test_news_of_a_row_is_what_the_rows_above_leave():
    np.testing.assert_allclose(innovation_sizes(np.array([[2.0, 0.0], [3.0, 4.0]])), [1.0, 0.8])
