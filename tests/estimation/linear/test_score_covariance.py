import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.estimation.linear.search import autoregressive_covariance


@pytest.mark.parametrize("poles", [[0.0, 0.0], [0.8, 0.0], [0.9 * np.exp(0.3j), 0.9 * np.exp(-0.3j)]])
def test_variance_of_the_sum_whether_the_series_swings_or_not(poles):
    rng = np.random.default_rng(0)
    denominator = np.poly(poles).real
    series = lfilter([1.0], denominator, rng.normal(size=(40_000, 2)), axis=0) @ np.array([[1.0, 3.0], [0.0, 100.0]])
    mix = np.array([[1.0, 3.0], [0.0, 100.0]])
    want = mix.T @ mix / np.sum(denominator) ** 2
    found = autoregressive_covariance([series[:15_000], series[15_000:]])
    size = np.sqrt(np.diag(want))
    np.testing.assert_allclose(found / np.outer(size, size), want / np.outer(size, size), atol=0.15)


def test_short_and_constant_series_give_numbers():
    rng = np.random.default_rng(0)
    series = np.hstack([rng.normal(size=(30, 2)), np.zeros((30, 1))])
    found = autoregressive_covariance([series])
    assert np.all(np.isfinite(found))
    assert found[2, 2] == pytest.approx(0.0, abs=1e-9)
