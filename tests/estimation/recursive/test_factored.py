import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from idloop.estimation.recursive.step import (
    add_variance,
    limit_variances,
    measurement_update,
    stable,
    time_update,
    variances,
)

sizes, seeds = st.integers(1, 6), st.integers(0, 1000)


def factors(size, seed):
    rng = np.random.default_rng(seed)
    upper = np.triu(rng.normal(size=(size, size)), 1) + np.eye(size)
    return upper, np.exp(rng.normal(size=size)), rng


def dense(upper, diagonal):
    return (upper * diagonal) @ upper.T


@given(size=sizes, seed=seeds)
def test_a_measurement_is_the_kalman_update(size, seed):
    upper, diagonal, rng = factors(size, seed)
    p, h, r, gain = dense(upper, diagonal), rng.normal(size=size), 0.7, np.empty(size)
    total = measurement_update(upper, diagonal, h, r, gain)
    assert np.isclose(total, h @ p @ h + r)
    np.testing.assert_allclose(gain, p @ h / total, atol=1e-12)
    np.testing.assert_allclose(dense(upper, diagonal), p - np.outer(p @ h, p @ h) / total, atol=1e-10)


@given(size=sizes, seed=seeds, index=st.integers(0, 5), variance=st.floats(0.0, 10.0))
def test_widening_adds_to_one_variance(size, seed, index, variance):
    upper, diagonal, _ = factors(size, seed)
    index %= size
    expected = dense(upper, diagonal)
    expected[index, index] += variance
    add_variance(upper, diagonal, index, variance, np.empty(size))
    np.testing.assert_allclose(dense(upper, diagonal), expected, atol=1e-10)
    np.testing.assert_array_equal(np.diag(upper), 1.0)


@given(size=sizes, seed=seeds, quiet=st.integers(0, 6))
def test_a_step_in_time_is_that_of_the_covariance(size, seed, quiet):
    upper, diagonal, rng = factors(size, seed)
    forward, noise = rng.normal(size=(size, size)), np.exp(rng.normal(size=size))
    noise[:quiet] = 0.0
    expected = forward @ dense(upper, diagonal) @ forward.T + np.diag(noise)
    time_update(upper, diagonal, forward @ upper, noise, np.empty((size, size + 1)))
    np.testing.assert_allclose(dense(upper, diagonal), expected, rtol=1e-8, atol=1e-8)
    np.testing.assert_array_equal(upper, np.triu(upper, 1) + np.eye(size))
    assert np.all(diagonal >= 0.0)


@given(size=sizes, seed=seeds)
def test_the_limit_keeps_correlations(size, seed):
    upper, diagonal, rng = factors(size, seed)
    before, most, variance = dense(upper, diagonal), np.exp(rng.normal(size=size)), np.empty(size)
    variances(upper, diagonal, variance)
    np.testing.assert_allclose(variance, np.diag(before))
    limit_variances(upper, diagonal, variance, most)
    after = dense(upper, diagonal)
    np.testing.assert_allclose(np.diag(after), np.minimum(np.diag(before), most))
    root = np.sqrt(np.diag(after) / np.diag(before))
    np.testing.assert_allclose(after, before * np.outer(root, root), atol=1e-10)


def test_the_factors_survive_what_a_plain_update_does_not():
    # Two almost equal directions and next to no noise: the plain formula loses its sign.
    upper, diagonal, gain = np.eye(2), np.full(2, 1e8), np.empty(2)
    plain = 1e8 * np.eye(2)
    for h in (np.array([1.0, 1.0]), np.array([1.0, 1.0 + 1e-8])):
        measurement_update(upper, diagonal, h, 1e-8, gain)
        plain -= np.outer(plain @ h, plain @ h) / (h @ plain @ h + 1e-8)
    assert np.all(diagonal > 0.0)
    assert np.linalg.eigvalsh(0.5 * (plain + plain.T))[0] < np.linalg.eigvalsh(dense(upper, diagonal))[0]


@given(st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=5), st.sampled_from([0.9, 0.999, 1.0]))
def test_stability_is_that_of_the_roots(tail, radius):
    size = np.max(np.abs(np.roots([1.0, *tail])), initial=0.0)
    if abs(size - radius) > 1e-4:
        assert stable(np.array(tail), radius) == (size < radius)
