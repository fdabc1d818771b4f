import numpy as np
import pytest

from idloop.estimation.subspace import select_order
from idloop.estimation.subspace.order import significant


@pytest.mark.parametrize("method", ["n4sid", "moesp", "cva"])
def test_selection_shows_the_gap(method, true, made):
    found = select_order(made(true, 3000, 0.2), method)
    assert found.order == 3
    assert found.singular_values[2] > 2.0 * found.singular_values[3]
    assert found.correlations[2] > found.threshold > found.correlations[3]


def test_canonical_correlations_of_variates_weights_are_the_singular_values(true, made):
    found = select_order(made(true, 3000, 0.2), "cva", horizon=10)
    np.testing.assert_allclose(found.singular_values[:8], found.correlations[:8], atol=1e-8)


def test_unrelated_data_stay_below_the_threshold():
    rng = np.random.default_rng(0)
    for _ in range(20):
        past, future = (np.linalg.qr(rng.normal(size=(2000, size)))[0] for size in (40, 20))
        order, threshold = significant(np.linalg.svd(past.T @ future)[1], 40, 20, 2000)
        assert order == 1
        assert np.linalg.svd(past.T @ future)[1][0] < threshold
