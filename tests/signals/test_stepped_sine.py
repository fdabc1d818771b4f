"""Stepped sines: segments without leakage, continuity, grids."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.signals import build_signal


@given(
    frequencies=st.lists(st.floats(0.5, 40.0), min_size=1, max_size=6),
    periods=st.integers(1, 5),
    settle=st.integers(0, 3),
)
def test_settled_part_holds_whole_periods_of_one_frequency(frequencies, periods, settle):
    signal = build_signal(
        "stepped_sine",
        sample_time=0.005,
        frequencies=frequencies,
        periods=periods,
        settle_periods=settle,
        amplitude=1.5,
    )
    assert len(signal.segments) == len(frequencies)
    assert signal.segments[-1].stop == signal.value.size
    stop = 0
    for segment, wanted in zip(signal.segments, frequencies, strict=True):
        assert segment.start == stop
        stop = segment.stop
        measured = signal.value[segment.settled : segment.stop]
        assert segment.frequency == pytest.approx(wanted, rel=0.51 / measured.size + 1e-9)
        assert segment.settled - segment.start >= settle * (0.999 / segment.frequency) / 0.005
        amplitude = 2.0 * np.abs(np.fft.rfft(measured)) / measured.size
        assert amplitude[periods] == pytest.approx(1.5)
        assert np.allclose(np.delete(amplitude, periods), 0.0, atol=1e-9)
    steepest = 2.0 * np.pi * max(segment.frequency for segment in signal.segments)
    assert np.all(np.abs(np.diff(signal.value)) <= 1.5 * steepest * 0.005 + 1e-9)


@pytest.mark.parametrize(("spacing", "middle"), [("linear", 5.05), ("logarithmic", 1.0)])
def test_grids(spacing, middle):
    signal = build_signal(
        "stepped_sine", sample_time=0.001, frequency_min=0.1, frequency_max=10.0, steps=3, spacing=spacing
    )
    assert signal.derived["frequencies"] == pytest.approx([0.1, middle, 10.0], rel=0.01)


def test_time_left_over_is_silent():
    signal = build_signal("stepped_sine", sample_time=0.01, duration=10.0, frequencies=[2.0])
    assert signal.segments[0].stop == 200
    assert np.all(signal.value[200:] == 0.0)
