"""What buckets must never lose, and how few points they leave."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from idloop.reporting.decimation import extremes

VALUES = st.floats(-1e9, 1e9) | st.just(float("nan"))


@st.composite
def streams(draw):
    n, k = draw(st.integers(1, 300)), draw(st.integers(1, 3))
    gaps = draw(arrays(float, n, elements=st.floats(0.0, 0.1)))
    return np.cumsum(gaps), draw(arrays(float, (n, k), elements=VALUES))


def safely(reduce, values):
    return [reduce(column[np.isfinite(column)], initial=0.0) for column in values.T]


@given(streams(), st.floats(0.001, 5.0))
def test_extremes_are_kept_nothing_is_invented_and_the_length_is_bounded(stream, width):
    time, values = stream
    few_time, few = extremes(time, values, width)
    assert safely(np.max, few) == safely(np.max, values)
    assert safely(np.min, few) == safely(np.min, values)
    buckets = int(np.floor(time[-1] / width)) - int(np.floor(time[0] / width)) + 1
    assert len(few_time) == len(few) <= min(len(time), 2 * buckets)
    assert np.all(np.diff(few_time) >= 0.0)
    assert (few_time[0], few_time[-1]) == (time[0], time[-1])
    for column in range(values.shape[1]):
        known = few[:, column][np.isfinite(few[:, column])]
        assert np.all(np.isin(known, values[:, column]))


@given(streams(), st.floats(0.05, 5.0))
def test_each_bucket_keeps_its_own_extremes(stream, width):
    time, values = stream
    few_time, few = extremes(time, values, width)
    for bucket in np.unique(np.floor(time / width)):
        ours, theirs = few[np.floor(few_time / width) == bucket], values[np.floor(time / width) == bucket]
        assert safely(np.max, ours) == safely(np.max, theirs)
        assert safely(np.min, ours) == safely(np.min, theirs)


def test_a_peak_of_one_sample_in_a_minute_at_1_khz_is_kept_where_it_is():
    time = np.arange(60_000) / 1000.0
    values = np.zeros((60_000, 1))
    values[31_234] = 7.0
    few_time, few = extremes(time, values, 0.1)
    assert len(few_time) == 1200
    (place,) = np.flatnonzero(few == 7.0)
    assert abs(few_time[place] - 31.234) <= 0.1


def test_the_two_points_of_a_bucket_come_in_the_order_of_their_samples():
    time = np.linspace(0.0, 0.9, 10)
    values = np.array([5.0, 4, 3, 2, 1, 0, 1, 2, 3, 4])[:, None]
    assert extremes(time, values, 1.0)[1].ravel().tolist() == [5.0, 0.0]
    assert extremes(time, -values, 1.0)[1].ravel().tolist() == [-5.0, 0.0]


def test_no_sample_is_no_point():
    time, values = extremes(np.empty(0), np.empty((0, 2)), 0.1)
    assert time.shape == (0,)
    assert values.shape == (0, 2)
