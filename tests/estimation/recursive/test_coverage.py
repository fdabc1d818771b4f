"""Standard errors: how often the interval of a method holds the truth."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.estimation.black_box.methods import METHODS, Choices
from idloop.estimation.recursive import (
    pseudo_linear_regression,
    recursive_armax,
    recursive_arx,
    recursive_estimator,
    recursive_output_error,
)
from idloop.estimation.recursive.methods import orders_of

POLES = [1.0, -1.5, 0.7]
RUNS = 120


def errors(make, made, truth, samples, runs=RUNS, **system):
    """Error and standard error of every coefficient in every run."""
    off, claimed = [], []
    for seed in range(runs):
        data = made(samples, seed, **system)
        estimator = make()
        estimator.update_block(data.input, data.output[:, 0])
        off.append(estimator.coefficients - truth)
        claimed.append(estimator.stderr)
    return np.array(off), np.array(claimed)


def covered(off, claimed):
    return np.mean(np.abs(off) < 1.96 * claimed)


@pytest.mark.parametrize("samples", [2000, 8000])
@pytest.mark.parametrize("c", [[1, -1, 0.2], [1, 0.8, 0.3], [1, -0.5, 0.2]])
def test_intervals_of_pseudo_linear_regression_hold_the_truth_as_often_as_they_say(made, samples, c):
    truth = [*POLES[1:], 1.0, 0.5, *c[1:]]
    off, claimed = errors(
        lambda: recursive_estimator("rplr", orders_of("rplr", 2, 1)), made, truth, samples, a=POLES, c=c
    )
    assert 0.92 < covered(off, claimed) < 0.98
    # Of each coefficient the count of the runs is binomial: 0.90 to 0.99 are 2.5 standard deviations at most.
    assert np.all(np.mean(np.abs(off) < 1.96 * claimed, axis=0) >= 0.90)
    np.testing.assert_allclose(np.median(claimed, axis=0), np.std(off, axis=0), rtol=0.25)


def test_pseudo_linear_regression_is_less_exact_than_the_prediction_error_method_and_says_so(made):
    data = made(8000, 0, a=POLES, c=[1, -1, 0.2])
    claimed = []
    for method in ("pseudo-linear", "gradient"):
        estimator = recursive_armax(2, 2, 2, method=method)
        estimator.update_block(data.input, data.output[:, 0])
        claimed.append(estimator.stderr)
    assert np.all(claimed[0] > claimed[1])


@pytest.mark.parametrize("forgetting", [1.0, 0.99])
def test_intervals_of_an_output_error_model_by_pseudo_linear_regression(made, forgetting):
    off, claimed = errors(
        lambda: pseudo_linear_regression(nb=2, nf=2, forgetting=forgetting), made, [1.0, 0.5, *POLES[1:]], 2000, f=POLES
    )
    assert 0.90 < covered(off, claimed) < 0.99


def test_the_covariance_on_the_way_is_that_at_the_end(made):
    data = made(400, 0, a=POLES, c=[1, 0.5])
    estimator = recursive_armax(2, 2, 1, method="pseudo-linear", forgetting=0.99)
    _, _, claimed = estimator.follow(data.input, data.output[:, 0])
    np.testing.assert_allclose(claimed[-1], estimator.stderr, rtol=1e-12)
    covariance = estimator.covariance
    np.testing.assert_allclose(covariance, covariance.T, rtol=1e-12)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0


def test_without_a_noise_model_the_carried_covariance_is_the_inverse_of_the_information(made):
    # With F = 1 the regressor is the gradient, so both ways have to agree.
    data = made(2000, 0)
    methods = [recursive_output_error(2, 1, method=method, start=[0, 0, 0]) for method in ("gradient", "pseudo-linear")]
    for estimator in methods:
        estimator.update_block(data.input, data.output[:, 0])
    np.testing.assert_allclose(methods[1].stderr, methods[0].stderr, rtol=0.05)


@pytest.mark.parametrize(("c", "slow"), [([1, 1.8, 0.9], True), ([1, 0.8, 0.3], False)])
def test_noise_that_it_learns_too_slowly_is_noted(made, c, slow):
    data = [made(4000, 0, a=POLES, c=c)]
    for name, told in (("rplr", slow), ("rpem", False)):
        model, _ = METHODS[name].run(data, Choices(order=2), 2, 1)
        assert any("hardly positive real" in note for note in model.notes) == told


def test_a_filter_for_coefficients_that_wander_claims_more_than_constant_ones_spread(made):
    off, claimed = errors(lambda: recursive_arx(2, 2, drift=1e-3), made, [*POLES[1:], 1.0, 0.5], 8000, a=POLES)
    # In the steady state P = K r claims K r, of which the noise is K^2 r / (1 - (1 - K)^2) = K r / 2 for a small gain.
    ratio = np.median(claimed, axis=0) / np.std(off, axis=0)
    np.testing.assert_allclose(ratio, np.sqrt(2.0), rtol=0.2)
