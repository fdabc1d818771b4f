"""Filters do not delay, resampling invents nothing."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.filtering import resample_held, resample_linear, zero_phase

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


def test_held_and_linear():
    time, value = np.array([0.0, 1.0, 2.0, 10.0]), np.array([1.0, 3.0, 5.0, 7.0])
    at = np.array([-0.1, 0.0, 0.5, 1.0, 2.0, 6.0, 10.0, 11.0])
    np.testing.assert_array_equal(resample_held(time, value, at), [np.nan, 1, 1, 3, 5, 5, 7, 7])
    np.testing.assert_array_equal(
        resample_linear(time, value, at, longest=5.0), [np.nan, 1, 2, 3, 5, np.nan, 7, np.nan]
    )
