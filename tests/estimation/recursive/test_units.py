"""Units are a matter of taste: every method gives the same model and the same predictions in any of them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from idloop.estimation.recursive import RECURSIVE_METHODS, ExtendedKalman, recursive_arx, recursive_estimator
from idloop.estimation.recursive.methods import orders_of

POLES = [1.0, -1.5, 0.7]
exponents = st.floats(-6.0, 6.0)


def at_rest(made, silent, **system):
    """Command and output of a plant that stands still at first."""
    data = made(300, **system)
    return (np.concatenate([np.zeros(silent), one]) for one in (data.input[:, 0], data.output[:, 0]))


def followed(method, u, y, **options):
    return recursive_estimator(method, orders_of(method, 2, 1), **options).follow(u, y)


def same_in_other_units(method, u, y, k, g):
    left, values, stderr = followed(method, u, y)
    moved = followed(method, k * u, g * y)
    names = recursive_estimator(method, orders_of(method, 2, 1)).names
    unit = np.array([g / k if name.startswith("b") else 1.0 for name in names])
    size = np.sqrt(np.mean(y**2))
    np.testing.assert_allclose((g * y - moved[0]) / g, y - left, rtol=1e-6, atol=1e-6 * size)
    np.testing.assert_allclose(moved[1] / unit, values, rtol=1e-6, atol=1e-6)
    # Before its command has moved, a coefficient of B has no size to be uncertain by.
    known = np.flatnonzero(u)[0] + 2
    np.testing.assert_allclose(moved[2][known:] / unit, stderr[known:], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("method", RECURSIVE_METHODS)
@pytest.mark.parametrize("silent", [0, 1, 150, 900])
@settings(max_examples=10)
@given(exponents, exponents)
def test_units_change_no_prediction_and_no_coefficient_at_any_instant(made, method, silent, command, measurement):
    u, y = at_rest(made, silent, a=POLES, c=[1, 0.5])
    same_in_other_units(method, u, y, 10.0**command, 10.0**measurement)


@pytest.mark.parametrize("method", RECURSIVE_METHODS)
@pytest.mark.parametrize(("k", "g"), [(1e-6, 1e5), (1e6, 1e-6), (1e3, 1e-3)])
def test_units_do_not_matter_where_a_noisy_plant_is_moved_late(made, method, k, g):
    # The command is silent in all of the samples that tell the sizes.
    u, y = at_rest(made, 500, a=POLES)
    same_in_other_units(method, u, y + 0.1 * np.random.default_rng(0).normal(size=800), k, g)


@pytest.mark.parametrize("method", RECURSIVE_METHODS)
@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e6])
def test_no_sample_of_the_start_is_predicted_far_beyond_what_was_seen(made, method, scale):
    for seed in range(5):
        data = made(100, seed, noise=0.1, a=POLES)
        left, _, _ = followed(method, data.input[:, 0], scale * data.output[:, 0])
        assert np.max(np.abs(left)) < 2.0 * scale * np.max(np.abs(data.output))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["rarx", "ekf"])
@given(st.lists(st.integers(1, 300), min_size=1, max_size=6))
def test_a_plant_at_rest_is_taken_sample_by_sample_as_in_blocks(made, method, cut):
    u, y = at_rest(made, 700, a=POLES)
    whole, parts = (recursive_estimator(method, orders_of(method, 2, 1)) for _ in range(2))
    expected = whole.update_block(u, y)
    edges = np.unique(np.clip(np.cumsum([0, *cut, 1000]), 0, 1000))
    found = [parts.update_block(u[i:j], y[i:j]) for i, j in pairwise(edges)]
    np.testing.assert_array_equal(np.concatenate(found), expected)
    np.testing.assert_array_equal(parts.coefficients, whole.coefficients)


@pytest.mark.parametrize("scale", [1.0, 1e6])
@pytest.mark.parametrize(("method", "bound"), [("rarx", 1e-3), ("ekf", 0.02)])
def test_a_plant_that_stood_still_at_first_is_known_as_well_as_another(made, method, bound, scale):
    u, y = at_rest(made, 600, a=POLES)
    rested, moved = (recursive_estimator(method, orders_of(method, 2, 1)) for _ in range(2))
    rested.update_block(u, scale * y)
    moved.update_block(u[600:], scale * y[600:])
    unit = np.array([1.0, 1.0, scale, scale])
    np.testing.assert_allclose(rested.coefficients / unit, moved.coefficients / unit, atol=bound)


def test_an_input_that_comes_late_is_learnt_in_its_own_units():
    rng = np.random.default_rng(1)
    u = rng.normal(size=(1500, 2))
    u[:600, 1] = 0.0
    y = np.zeros(1500)
    for t in range(1, 1500):
        y[t] = 0.5 * y[t - 1] + u[t - 1, 0] + 2.0 * u[t - 1, 1] + 0.05 * rng.normal()
    for scale in (1e-7, 1.0, 1e7):
        plain = recursive_arx(1, (1, 1))
        joint = ExtendedKalman(plain.orders)
        for estimator in (plain, joint):
            estimator.update_block(u * [1.0, scale], y)
            np.testing.assert_allclose(estimator.coefficients * [1.0, 1.0, scale], [-0.5, 1.0, 2.0], atol=0.02)
