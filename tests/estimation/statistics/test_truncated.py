"""Least squares in the directions that the data determine."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from idloop.estimation.statistics.truncated import directions


@given(st.integers(0, 2**31), st.integers(1, 6), st.floats(1e-3, 0.5))
def test_the_directions_are_those_of_a_singular_value_decomposition(seed: int, count: int, least: float) -> None:
    random = np.random.default_rng(seed)
    table = random.normal(size=(50, count)) * 10.0 ** random.uniform(-2.0, 2.0, count)
    vectors, values = directions(table.T @ table, least)
    _, known, right = np.linalg.svd(table, full_matrices=False)
    kept = known > least * known[0]
    np.testing.assert_allclose(values[::-1], known[kept], rtol=1e-6)
    np.testing.assert_allclose(vectors @ vectors.T, right[kept].T @ right[kept], atol=1e-6)


def test_no_direction_of_nothing() -> None:
    vectors, values = directions(np.zeros((3, 3)), 1e-3)
    assert vectors.shape == (3, 0)
    assert len(values) == 0
