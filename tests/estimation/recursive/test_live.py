"""Recursion on a running stream: the same as on a record, whatever the blocks, holes and late samples."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.estimation.black_box.methods import METHODS
from idloop.estimation.recursive import RECURSIVE_METHODS, LiveRecursion, recursive_estimator
from idloop.estimation.recursive.methods import orders_of

TS = 0.01


def stream(count: int = 400, seed: int = 0):
    """Time, command and two outputs of a first- and a second-order system."""
    rng = np.random.default_rng(seed)
    u = np.sign(rng.standard_normal(count))
    y = np.zeros((count, 2))
    for t in range(2, count):
        y[t, 0] = 0.8 * y[t - 1, 0] + 0.5 * u[t - 1] + 0.05 * rng.standard_normal()
        y[t, 1] = 1.5 * y[t - 1, 1] - 0.7 * y[t - 2, 1] + u[t - 1] + 0.05 * rng.standard_normal()
    return TS * np.arange(count), u, y


@given(st.lists(st.integers(1, 90), min_size=1, max_size=8))
def test_blocks_of_any_length_give_the_same(lengths):
    time, u, y = stream()
    whole, parts = (LiveRecursion("rarmax", ("a", "b"), sample_time=TS) for _ in range(2))
    expected = whole.update_block(time, u, y)
    edges = np.unique(np.clip(np.cumsum([0, *lengths, len(time)]), 0, len(time)))
    found = np.vstack([parts.update_block(time[i:j], u[i:j], y[i:j]) for i, j in pairwise(edges)])
    np.testing.assert_array_equal(found, expected)
    assert parts.coefficients == whole.coefficients


@pytest.mark.parametrize("method", RECURSIVE_METHODS)
def test_every_method_is_that_of_records(method):
    time, u, y = stream()
    live = LiveRecursion(method, ("a", "b"), sample_time=TS)
    live.update_block(time, u, y)
    alone = recursive_estimator(method, orders_of(method, 2, 1), sample_time=TS)
    alone.update_block(u, y[:, 1])
    np.testing.assert_array_equal([one.value for one in live.coefficients if one.output == "b"], alone.coefficients)
    assert METHODS[method].kind == "recursive"
    assert set(METHODS[method].polynomials) == set(RECURSIVE_METHODS[method].degrees)


def test_samples_that_are_not_there_are_predicted_through():
    time, u, y = stream()
    there = np.ones(len(time), dtype=bool)
    there[[150, 151, 260]] = False
    live = LiveRecursion("rarx", ("a", "b"), sample_time=TS)
    found = live.update_block(time[there], u[there], y[there])
    y[~there], u[~there] = np.nan, np.nan
    alone = recursive_estimator("rarx", orders_of("rarx", 2, 1), sample_time=TS)
    np.testing.assert_array_equal(found[:, 0], alone.update_block(u, y[:, 0])[there])
    assert live.samples == {"a": 397, "b": 397}


def test_a_late_sample_is_left_out_and_a_long_hole_ends_the_memory_of_the_signals():
    time, u, y = stream()
    live = LiveRecursion("rarx", ("a", "b"), sample_time=TS)
    live.update_block(time, u, y)
    before = live.coefficients
    assert np.all(np.isnan(live.update_block(time[-1:], u[-1:], y[-1:])))
    assert (live.late, live.coefficients) == (1, before)
    # After the hole the axis stands still: without the old signals nothing is to be expected of it.
    left = live.update_block(time[-1:] + 3600.0, [0.0], np.zeros((1, 2)))
    assert live.holes == 1
    np.testing.assert_array_equal(left, np.zeros((1, 2)))


def test_infinite_and_missing_values_teach_nothing():
    time, u, y = stream()
    y[50:60, 0] = np.inf
    y[70:80, 0] = np.nan
    u[90] = -np.inf
    live = LiveRecursion("rarx", ("a", "b"), sample_time=TS)
    live.update_block(time, u, y)
    assert live.samples == {"a": 380, "b": 400}
    assert all(np.isfinite(one.value) and np.isfinite(one.stderr) for one in live.coefficients)
    assert live.innovation_std["b"] > 0.0


def test_coefficients_that_wander_are_followed_by_the_kalman_filter_only():
    rng = np.random.default_rng(1)
    count = 4000
    u = rng.standard_normal(count)
    gain = np.where(np.arange(count) < count // 2, 1.0, 2.0)
    y = np.zeros(count)
    for t in range(1, count):
        y[t] = 0.5 * y[t - 1] + gain[t] * u[t - 1] + 0.1 * rng.standard_normal()
    found = {}
    for method in ("rarx", "kalman"):
        live = LiveRecursion(method, ("y",), sample_time=TS, order=1)
        live.update_block(TS * np.arange(count), u, y[:, None])
        found[method] = live.coefficients[1].value
    assert abs(found["kalman"] - 2.0) < 0.1
    assert abs(found["rarx"] - 2.0) > 0.2


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: LiveRecursion("rarmx", ("y",), sample_time=TS), "no recursive method 'rarmx'.*rarmax"),
        (lambda: LiveRecursion("rarx", ("y",), sample_time=0.0), "sample time"),
        (lambda: LiveRecursion("rarx", ("y",), sample_time=TS, order=-1), "-1"),
        (lambda: LiveRecursion("rarx", ("y",), sample_time=TS, drift=-1.0), "drift"),
        (lambda: LiveRecursion("rarx", ("y",), sample_time=TS).update_block([0.0], [0.0], [0.0]), "shapes"),
    ],
)
def test_wrong_use_is_one_line(make, words):
    with pytest.raises(InputError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)
