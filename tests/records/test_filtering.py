"""Filters do not delay, resampling invents nothing, unwrapping undoes the wrap."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.records.filtering import resample_held, resample_linear, unwrap, zero_phase

TIME = np.arange(2000) / 1000


def test_pass_band_is_kept_without_delay_and_stop_band_removed():
    slow, fast = np.sin(2 * np.pi * 3 * TIME), np.sin(2 * np.pi * 200 * TIME)
    result = zero_phase(TIME, slow + fast, None, 30.0)
    np.testing.assert_allclose(result[200:-200], slow[200:-200], atol=2e-3)
    np.testing.assert_allclose(zero_phase(TIME, slow + fast, 60.0, None)[200:-200], fast[200:-200], atol=2e-2)


def test_jitter_and_holes_are_allowed():
    rng = np.random.default_rng(0)
    time = TIME + 1e-4 * rng.random(TIME.size)
    value = np.sin(2 * np.pi * 3 * time)
    value[500:700:3] = np.nan
    result = zero_phase(time, value, None, 50.0)
    assert np.array_equal(np.isnan(result), np.isnan(value))
    known = np.isfinite(value)
    known[:100] = known[-100:] = False
    np.testing.assert_allclose(result[known], np.sin(2 * np.pi * 3 * time)[known], atol=5e-3)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (None, 600.0, "half the sample rate"),
        (20.0, 10.0, "empty"),
        (None, None, "needs an edge"),
        (-1.0, None, "between 0"),
    ],
)
def test_bands_that_cannot_be(low, high, words):
    with pytest.raises(InputError, match=words):
        zero_phase(TIME, TIME, low, high)


def test_too_short_for_a_filter():
    with pytest.raises(InputError, match="too few"):
        zero_phase(TIME[:20], TIME[:20], None, 10.0)


@given(
    steps=st.lists(st.floats(-0.45, 0.45), min_size=1, max_size=60),
    span=st.sampled_from([1.0, 2 * np.pi, 4096.0]),
)
def test_unwrap_undoes_the_wrap(steps, span):
    true = np.cumsum(np.array(steps)) * span
    wrapped = np.mod(true, span)
    wrapped[1::7] = np.nan
    result = unwrap(wrapped, span)
    known = np.isfinite(wrapped)
    assert np.array_equal(np.isfinite(result), known)
    if not (~known).any():
        np.testing.assert_allclose(np.diff(result), np.diff(true), atol=1e-9 * span)


@pytest.mark.parametrize("span", [0.0, -1.0, np.nan])
def test_unwrap_needs_a_range(span):
    with pytest.raises(InputError, match="encoder range"):
        unwrap(np.zeros(3), span)


def test_held_and_linear():
    time, value = np.array([0.0, 1.0, 2.0, 10.0]), np.array([1.0, 3.0, 5.0, 7.0])
    at = np.array([-0.1, 0.0, 0.5, 1.0, 2.0, 6.0, 10.0, 11.0])
    np.testing.assert_array_equal(resample_held(time, value, at), [np.nan, 1, 1, 3, 5, 5, 7, 7])
    np.testing.assert_array_equal(
        resample_linear(time, value, at, longest=5.0), [np.nan, 1, 2, 3, 5, np.nan, 7, np.nan]
    )
