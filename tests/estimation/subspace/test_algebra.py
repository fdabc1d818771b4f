import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from idloop.estimation.subspace import compression as compression_module
from idloop.estimation.subspace.compression import compress
from idloop.estimation.subspace.projection import evidence_regression, regress, row_basis
from idloop.estimation.subspace.realisation import Noise, reflected, toeplitz


@pytest.mark.parametrize("exact", [True, False])
def test_compression_has_the_moments_of_all_windows(true, made, monkeypatch, exact):
    monkeypatch.setattr(compression_module, "_SMALLEST_BLOCK", 64)
    monkeypatch.setattr(compression_module, "_SUMMED_AT_ONCE", 64)
    parts = [made(true, 300, 0.1, seed) for seed in range(2)]
    found = compress(parts, 4, exact=exact)
    assert found.squared is not exact
    windows = []
    for part in parts:
        joint = np.hstack([part.input / found.input_scale, part.output / found.output_scale])
        windows += [joint[k : k + 4].ravel() for k in range(len(part) - 3)]
    moments = np.array(windows).T @ np.array(windows) / len(windows)
    assert found.windows == len(windows)
    np.testing.assert_allclose(found.factor @ found.factor.T, moments, atol=1e-12)
    np.testing.assert_allclose(found.y(1, 3) @ found.u(0, 1).T, moments[[4, 5, 7, 8]][:, [0]], atol=1e-12)


@given(seed=st.integers(0, 100), size=st.integers(1, 7))
def test_reflection_mirrors_what_is_outside_and_leaves_the_rest(seed, size):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(size, size))
    before, after = np.linalg.eigvals(a), np.linalg.eigvals(reflected(a))
    want = np.where(np.abs(before) >= 1.0, 1.0 / np.conj(before), before)
    assert np.all(np.abs(after) < 1.0)
    for pole in want:
        assert np.min(np.abs(after - pole)) < 1e-6 * max(np.linalg.norm(a), 1.0)


def test_integrators_are_moved_just_inside():
    assert np.all(np.abs(np.linalg.eigvals(reflected(np.array([[1.0, 0.1], [0.0, 0.5]])))) < 1.0)


@given(seed=st.integers(0, 60))
def test_kalman_gain_with_correlated_noise_is_that_of_scipy(seed):
    rng = np.random.default_rng(seed)
    a, c = 0.5 * rng.normal(size=(3, 3)), rng.normal(size=(2, 3))
    root = rng.normal(size=(5, 8))
    covariance = root @ root.T
    noise = Noise(covariance[:3, :3], covariance[3:, 3:], covariance[:3, 3:])
    p = solve_discrete_are(a.T, c.T, noise.process, noise.output, s=noise.cross)
    want = (a @ p @ c.T + noise.cross) @ np.linalg.inv(c @ p @ c.T + noise.output)
    np.testing.assert_allclose(noise.kalman_gain(a, c), want, rtol=1e-4, atol=1e-5)


def test_without_noise_a_stable_model_needs_no_gain_and_an_unstable_one_gets_a_stabilising_one():
    nothing = Noise(np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)))
    c = np.ones((1, 1))
    assert abs(nothing.kalman_gain(np.array([[0.9]]), c)[0, 0]) < 1.0
    gain = nothing.kalman_gain(np.array([[1.5]]), c)
    assert abs(1.5 - gain[0, 0]) < 1.0


def test_toeplitz_of_markov_parameters():
    np.testing.assert_array_equal(
        toeplitz([np.array([[1.0, 2.0]]), np.array([[3.0, 4.0]])]), [[1.0, 2.0, 0.0, 0.0], [3.0, 4.0, 1.0, 2.0]]
    )


def test_dependent_rows_get_the_smallest_coefficients():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(3, 20))
    twice = np.vstack([rows, rows])
    np.testing.assert_allclose(regress(rows[:1], twice), [[0.5, 0, 0, 0.5, 0, 0]], atol=1e-12)
    assert row_basis(twice).shape == (3, 20)


@pytest.mark.parametrize("samples", [400, 40_000])
def test_the_ridge_gives_way_to_the_data(samples):
    rng = np.random.default_rng(0)
    x = rng.normal(size=(6, samples)) * np.array([[1], [1], [1], [1], [1], [1e-3]])
    y = np.array([[1.0, -0.5, 0.3, 0.0, 0.2, 0.0]]) @ x + 0.3 * rng.normal(size=(1, samples))
    factor = np.linalg.qr(np.vstack([x, y]).T, mode="r").T / np.sqrt(samples)
    found = evidence_regression(factor[6:], factor[:6], samples, 1e-8)
    plain = regress(factor[6:], factor[:6])
    true = np.array([1.0, -0.5, 0.3, 0.0, 0.2, 0.0])
    np.testing.assert_allclose(found[0, :5], true[:5], atol=5 * 0.3 / np.sqrt(samples))
    # The direction that the data hardly show is left near zero instead of filled with noise.
    assert abs(found[0, 5]) < 0.3 * abs(plain[0, 5])


@given(seed=st.integers(0, 200), count=st.integers(1, 12), smallest=st.sampled_from([0, -3, -6, -13, -15]))
def test_a_basis_and_a_regression_are_those_of_the_singular_values_that_count(seed, count, smallest):
    rng = np.random.default_rng(seed)
    left, right = (np.linalg.qr(rng.normal(size=(n, count)))[0] for n in (count, 30))
    values = np.logspace(0, smallest, count) if count > 1 else np.ones(1)
    values[1:] = np.where(values[1:] > 1e-9, values[1:], 1e-14)  # far from the tolerance, on either side
    rows, kept = (left * values) @ right.T, values > 1e-9
    span = right[:, kept] @ right[:, kept].T
    basis = row_basis(rows)
    assert len(basis) == np.count_nonzero(kept)
    np.testing.assert_allclose(basis.T @ basis, span, atol=1e-5)
    target = rng.normal(size=(2, 30))
    np.testing.assert_allclose(regress(target, rows) @ rows, target @ span, atol=1e-5)
    if smallest >= -3:
        np.testing.assert_allclose(regress(target, rows), target @ np.linalg.pinv(rows), rtol=1e-9, atol=1e-9)
