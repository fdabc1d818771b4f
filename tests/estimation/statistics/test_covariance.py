from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from idloop.estimation.statistics.covariance import (
    estimate_covariance,
    jackknife,
    long_run_covariance,
    sandwich,
    white_covariance,
    widest,
)


def test_long_run_variance_of_an_autoregression() -> None:
    rng = np.random.default_rng(0)
    g = lfilter([1.0], [1.0, -0.8], rng.normal(size=50_000))[:, None]
    assert long_run_covariance([g])[0, 0] == pytest.approx(1.0 / (1.0 - 0.8) ** 2, rel=0.15)


def test_a_parameter_that_moves_nothing_has_no_standard_error() -> None:
    rng = np.random.default_rng(2)
    jacobian, residual = rng.normal(size=(400, 3)), rng.normal(size=400)
    jacobian[:, 1] = 0.0
    rows = np.array_split(np.arange(400), 40)
    problem = SimpleNamespace(scores=lambda _, e, j: [j * e[:, None]], segments=lambda _, count: rows)
    covariance = estimate_covariance(problem, np.zeros(3), residual, jacobian)
    alone = estimate_covariance(problem, np.zeros(2), residual, jacobian[:, [0, 2]])
    assert np.isnan(covariance[1]).all()
    assert np.isnan(covariance[:, 1]).all()
    assert covariance[np.ix_([0, 2], [0, 2])] == pytest.approx(alone)


def test_regression_interval_under_coloured_noise() -> None:
    rng = np.random.default_rng(1)
    hits = 0
    for _ in range(200):
        x = lfilter([1.0], [1.0, -0.9], rng.normal(size=1000))
        y = 2.0 * x + lfilter([1.0], [1.0, -0.9], rng.normal(size=1000))
        slope = x @ y / (x @ x)
        variance = sandwich(np.array([[x @ x]]), [(x * (y - slope * x))[:, None]])[0, 0]
        hits += abs(slope - 2.0) < 1.96 * np.sqrt(variance)
    # A white-noise formula covers about half here.
    assert hits >= 175


@given(st.integers(0, 1000), st.floats(1e-6, 1e6))
def test_covariance_follows_units_and_is_semidefinite(seed: int, unit: float) -> None:
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(200, 2))
    scores = jacobian * rng.normal(size=(200, 1))
    plain = sandwich(jacobian.T @ jacobian, [scores])
    scale = np.array([1.0, unit])
    other = sandwich((jacobian * scale).T @ (jacobian * scale), [scores * scale])
    assert other == pytest.approx(plain / np.outer(scale, scale), rel=1e-6)
    assert np.min(np.linalg.eigvalsh(plain)) >= -1e-12


def test_dead_component_stays_finite() -> None:
    rng = np.random.default_rng(2)
    g = np.column_stack([rng.normal(size=300), np.zeros(300)])
    assert np.all(np.isfinite(long_run_covariance([g])))


def test_jackknife_agrees_with_theory_on_white_residuals() -> None:
    rng = np.random.default_rng(3)
    jacobian = rng.normal(size=(4000, 2)) * [1.0, 1e-3]
    blocks = [np.arange(start, start + 100) for start in range(0, 4000, 100)]
    found = np.mean([np.diag(jackknife(jacobian, rng.normal(size=4000), blocks)) for _ in range(50)], axis=0)
    assert found == pytest.approx(np.diag(white_covariance(jacobian)), rel=0.15)


def test_jackknife_counts_segments_not_samples() -> None:
    # A residual that is constant within each segment carries one piece of evidence per segment.
    rng = np.random.default_rng(4)
    level = np.repeat(rng.normal(size=40), 50)
    blocks = [np.arange(start, start + 50) for start in range(0, 2000, 50)]
    assert jackknife(np.ones((2000, 1)), level, blocks)[0, 0] == pytest.approx(1.0 / 40.0, rel=0.5)


def test_the_jackknife_does_not_apply_to_what_one_segment_determines() -> None:
    rng = np.random.default_rng(3)
    jacobian = rng.normal(size=(400, 2))
    jacobian[10:, 1] = 0.0
    blocks = [np.arange(k, k + 10) for k in range(0, 400, 10)]
    residual = rng.normal(size=400)
    found = jackknife(jacobian, residual, blocks)
    assert found[1, 1] == 0.0
    assert found[0, 0] == pytest.approx(jackknife(jacobian[:, :1], residual, blocks)[0, 0], rel=0.2)


def test_widest_keeps_correlation_and_never_shrinks() -> None:
    first, other = np.array([[4.0, 1.0], [1.0, 1.0]]), np.diag([1.0, 9.0])
    assert widest([first, other]) == pytest.approx(np.array([[4.0, 3.0], [3.0, 9.0]]))
