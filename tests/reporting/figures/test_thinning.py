"""Fewer points: no peak, no gap and no end is lost, and no point is invented."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.reporting.figures.thinning import kept, thinned


@given(st.integers(0, 2**32 - 1), st.integers(3, 40), st.integers(1, 3000))
def test_the_extremes_of_every_stretch_stay(seed: int, buckets: int, count: int) -> None:
    random = np.random.default_rng(seed)
    x = np.cumsum(random.uniform(0.1, 1.0, count))
    y = random.normal(size=count)
    y[random.uniform(size=count) < 0.1] = np.nan
    index = kept(x, y, buckets)
    assert np.all(np.diff(index) > 0)
    assert len(index) <= max(3 * buckets + 2, 1)
    assert index[0] == 0
    assert index[-1] == count - 1
    width = (x[-1] - x[0]) / buckets
    for bucket in range(buckets):
        # The last one also holds its end.
        below = x < x[0] + (bucket + 1) * width if bucket < buckets - 1 else True
        inside = (x >= x[0] + bucket * width) & below & np.isfinite(y)
        if np.any(inside) and width > 0.0:
            left = y[index[inside[index]]]
            assert np.nanmin(left) <= np.min(y[inside]) + 1e-12
            assert np.nanmax(left) >= np.max(y[inside]) - 1e-12


def test_a_short_curve_stays_as_it_is() -> None:
    np.testing.assert_array_equal(kept(np.arange(10.0), np.zeros(10), 4), np.arange(10))


def test_a_spike_of_one_sample_in_a_long_record_is_drawn() -> None:
    time = np.arange(0.0, 600.0, 1e-3)
    value = np.zeros(len(time))
    value[123_456] = 7.0
    x, y = thinned(time, value, 500)
    assert len(x) < 1100
    assert np.max(y) == 7.0
    assert x[np.argmax(y)] == pytest.approx(123.456, abs=1e-4)


def test_a_long_gap_stays_a_gap() -> None:
    time = np.arange(100_000.0)
    value = np.where((time > 40_000) & (time < 60_000), np.nan, 1.0)
    x, y = thinned(time, value, 100)
    assert np.all(np.isnan(y[(x > 41_000) & (x < 59_000)]))
    assert np.any(np.isnan(y))
    assert np.all(np.isfinite(y[(x < 40_000) | (x > 60_000)]))
