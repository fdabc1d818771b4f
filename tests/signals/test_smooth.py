"""Smooth trajectories: targets, limits, continuity."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.signals import build_signal


@given(
    points=st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=5),
    velocity=st.floats(0.1, 5.0),
    acceleration=st.floats(0.5, 50.0),
    amplitude=st.floats(0.0, 3.0),
    offset=st.floats(-2.0, 2.0),
)
def test_points_are_reached_within_the_limits(points, velocity, acceleration, amplitude, offset):
    signal = build_signal(
        "smooth",
        sample_time=0.01,
        points=points,
        velocity_limit=velocity,
        acceleration_limit=acceleration,
        amplitude=amplitude,
        offset=offset,
        dwell=0.05,
    )
    assert signal.value[0] == 0.0
    for segment, point in zip(signal.segments, points, strict=True):
        rest = signal.value[segment.settled : segment.stop]
        assert np.all(rest == offset + amplitude * point)
    assert np.max(np.abs(signal.rate)) <= velocity * (1 + 1e-9)
    assert np.max(np.abs(np.diff(signal.value))) <= velocity * 0.01 * (1 + 1e-9)
    assert np.max(np.abs(np.diff(signal.value, 2)), initial=0.0) <= acceleration * 1e-4 * (1 + 1e-6)


def test_rate_is_the_derivative():
    signal = build_signal("smooth", sample_time=0.001, duration=20.0, seed=3)
    central = (signal.value[2:] - signal.value[:-2]) / 0.002
    assert np.allclose(signal.rate[1:-1], central, atol=1e-3)
    assert np.max(np.abs(signal.rate)) == pytest.approx(1.0, rel=1e-3)


def test_points_repeat_for_the_duration_and_the_last_is_held():
    signal = build_signal("smooth", sample_time=0.01, duration=30.0, points=[1.0, -1.0])
    assert signal.value.size == 3000
    assert len(signal.segments) > 4
    assert abs(signal.value[-1]) == 1.0
    assert signal.rate[-1] == 0.0


def test_a_move_that_does_not_fit_is_not_begun():
    signal = build_signal("smooth", sample_time=0.01, duration=1.0, points=[1.0], velocity_limit=0.1)
    assert np.all(signal.value == 0.0)
    assert "does not fit" in signal.notes[0]
