import numpy as np
import pytest

from idloop.validation.edges import round_edges


@pytest.mark.parametrize("size", [1e-320, 1e-308, 1e-250])
def test_a_span_that_no_unit_explains_is_one_bin(size):
    edges = round_edges(size * np.arange(100.0))
    assert len(edges) == 2
    assert edges[0] <= 0.0
    assert edges[1] >= 99.0 * size
