"""Parallel calls: results in order, errors at their place."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.estimation.likelihood.parallel import in_parallel, workers


@given(st.lists(st.integers()))
def test_results_come_in_the_order_of_the_items(items):
    assert list(in_parallel(lambda item: 3 * item, items)) == [3 * item for item in items]


def test_an_error_comes_at_the_place_of_its_item():
    results = in_parallel(lambda item: 1 / item, [2.0, 0.0, 4.0])
    assert next(results) == 0.5
    with pytest.raises(ZeroDivisionError):
        next(results)


@pytest.mark.skipif(workers() < 2, reason="one core")
def test_two_items_are_worked_on_at_once():
    together = threading.Barrier(2)
    assert list(in_parallel(lambda item: together.wait(timeout=60.0) >= 0, range(2))) == [True, True]


def test_no_warning_leaves_a_thread(recwarn):
    assert np.isnan(next(in_parallel(lambda item: np.zeros(1) / item, [0.0])))
    assert not recwarn.list
