"""A position is made continuous, over holes of the log by the speeds on both sides."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.records.unwrapping import unwrap


@given(
    steps=st.lists(st.floats(-0.45, 0.45), min_size=1, max_size=60),
    span=st.sampled_from([1.0, 2 * np.pi, 4096.0]),
)
def test_unwrap_undoes_the_wrap(steps, span):
    true = np.cumsum(np.array(steps)) * span
    wrapped = np.mod(true, span)
    wrapped[1::7] = np.nan
    found = unwrap(np.arange(len(true)) * 0.01, wrapped, span)
    known = np.isfinite(wrapped)
    assert np.array_equal(np.isfinite(found.value), known)
    assert found.doubtful == ()
    if not (~known).any():
        np.testing.assert_allclose(np.diff(found.value), np.diff(true), atol=1e-9 * span)


@given(speed=st.floats(-30.0, 30.0), length=st.floats(0.1, 5.0), start=st.floats(0.0, 1.0))
def test_an_axis_that_turns_steadily_is_followed_through_a_hole(speed, length, start):
    time = np.concatenate([np.arange(50), np.arange(50) + 49 + 100 * length]) * 0.01
    true = start + speed * time
    found = unwrap(time, np.mod(true, 1.0), 1.0)
    np.testing.assert_allclose(found.value - found.value[0], true - true[0], atol=1e-6)
    assert found.doubtful == ()


def test_where_the_speed_changes_much_in_a_hole_the_turns_are_doubtful():
    time = np.concatenate([np.arange(50) * 0.01, 1.5 + np.arange(50) * 0.01, 3.0 + np.arange(50) * 0.01])
    speed = np.repeat([10.0, 2.0, 2.0], 50)
    angle = np.cumsum(speed * np.gradient(time))
    found = unwrap(time, np.mod(angle, 1.0), 1.0)
    assert [start for start, _ in found.doubtful] == [pytest.approx(0.49)]
    assert found.doubtful[0][1] == pytest.approx(1.01)


def test_a_slow_axis_has_no_doubtful_holes_and_a_lone_sample_says_nothing():
    time = np.concatenate([np.arange(20) * 0.01, [3.0], 6.0 + np.arange(20) * 0.01])
    found = unwrap(time, np.full(41, 0.3), 1.0)
    assert found.doubtful == ()
    assert np.all(found.value == 0.3)
    alone = unwrap(np.array([0.0, 0.01, 0.02, 9.0]), np.array([0.1, 0.1, 0.1, 0.4]), 1.0)
    assert np.array_equal(alone.value, [0.1, 0.1, 0.1, 0.4])


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_samples_stay_as_they_are(count):
    value = np.full(count, 0.25)
    assert np.array_equal(unwrap(np.arange(count) * 1.0, value, 1.0).value, value)
    assert np.isnan(unwrap(np.arange(count) * 1.0, value * np.nan, 1.0).value).all()


@pytest.mark.parametrize("span", [0.0, -1.0, np.nan])
def test_unwrap_needs_a_range(span):
    with pytest.raises(InputError, match="encoder range"):
        unwrap(np.zeros(3), np.zeros(3), span)
