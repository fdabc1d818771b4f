"""Student's t: scale and weights."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from idloop.estimation.statistics.student import FREEDOM, log_density, scale_of, weights


def test_the_density_is_that_of_scipy() -> None:
    errors = np.linspace(-30.0, 30.0, 101)
    np.testing.assert_allclose(log_density(errors, 2.5), stats.t.logpdf(errors, FREEDOM, scale=2.5), rtol=1e-12)


@given(st.integers(0, 2**31), st.floats(1e-6, 1e6))
def test_the_scale_is_where_the_likelihood_is_largest(seed: int, size: float) -> None:
    errors = size * np.random.default_rng(seed).standard_t(FREEDOM, 300)
    scale = scale_of(errors)
    best = np.sum(log_density(errors, scale))
    for factor in (0.99, 1.01):
        assert np.sum(log_density(errors, factor * scale)) < best


def test_a_few_errors_far_out_hardly_move_the_scale() -> None:
    errors = np.random.default_rng(1).standard_t(FREEDOM, 1000)
    spoilt = errors.copy()
    spoilt[:10] = 1e4
    assert scale_of(spoilt) == pytest.approx(scale_of(errors), rel=0.05)
    assert weights(np.array([0.0]))[0] == pytest.approx(1.25)
    assert weights(np.array([100.0]))[0] < 1e-3


@pytest.mark.parametrize("still", [0.0, 0.6])
def test_the_scale_is_a_fixed_point_however_heavy_the_tails(still: float) -> None:
    random = np.random.default_rng(2)
    errors = random.laplace(size=2000) ** 3 * (random.uniform(size=2000) > still)
    scale = scale_of(errors)
    assert np.mean(weights(errors / scale) * errors**2) == pytest.approx(scale**2, rel=1e-6)
