import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm, solve_discrete_are

from idloop.errors import IdloopError
from idloop.estimation.observer.stationary import design, discretise, riccati


@given(st.integers(0, 10_000))
def test_doubling_agrees_with_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(4, 4))
    a *= 0.95 / max(abs(np.linalg.eigvals(a)))
    c, q = rng.normal(size=(2, 4)), np.diag(rng.uniform(0.1, 2.0, 4))
    r = np.diag(rng.uniform(0.1, 2.0, 2))
    assert riccati(a, c, q, r) == pytest.approx(solve_discrete_are(a.T, c.T, q, r), rel=1e-8, abs=1e-10)


def test_discretisation_of_an_integrated_random_walk() -> None:
    transition, covariance = discretise(np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([0.0, 2.0]), 0.5)
    assert transition == pytest.approx(np.array([[1.0, 0.5], [0.0, 1.0]]))
    assert covariance == pytest.approx(2.0 * np.array([[0.5**3 / 3, 0.5**2 / 2], [0.5**2 / 2, 0.5]]))


def test_unmeasured_position_does_not_break_the_design() -> None:
    a = np.array([[0.0, 1.0], [0.0, -2.0]])
    observer = design(a, np.array([[0.0, 1.0]]), np.array([0.0, 1.0]), 0.01, 0.1, np.array([0.05]))
    assert np.all(np.isfinite(observer.gain))
    assert observer.memory < 1000


@given(st.floats(-4.0, 4.0), st.floats(1e-4, 1.0))
def test_the_observer_is_stable_and_gain_scales_with_units(exponent: float, noise: float) -> None:
    a = np.array([[0.0, 1.0], [0.0, -2.0]])
    c, g = np.array([[1.0, 0.0]]), np.array([0.0, 1.0])
    observer = design(a, c, g, 0.01, 10.0**exponent, np.array([noise]))
    full = np.zeros((3, 3))
    full[:2, :2], full[:2, 2] = a, g
    closed = expm(full * 0.01) @ (np.eye(3) - observer.gain @ np.array([[1.0, 0.0, 0.0]]))
    assert np.max(np.abs(np.linalg.eigvals(closed))) < 1.0
    # The same sensor in millimetres.
    scaled = design(a, 1e3 * c, g, 0.01, 10.0**exponent, np.array([1e3 * noise]))
    assert 1e3 * scaled.gain == pytest.approx(observer.gain, rel=1e-6)


def test_unstable_unmeasured_motion_is_refused() -> None:
    with pytest.raises(IdloopError, match="unstable motion"):
        design(np.diag([5.0, -1.0]), np.array([[0.0, 1.0]]), np.array([1.0, 1.0]), 0.01, 1.0, np.array([0.1]))
