"""Figures that a signal reports about itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from idloop.signals import build_signal


def test_spectrum_of_a_sine_is_its_amplitude_at_its_frequency():
    signal = build_signal("sine", sample_time=0.001, duration=3.7, frequency=5.0, amplitude=2.5, offset=0.3)
    frequency, amplitude = signal.spectrum()
    line = int(np.argmax(amplitude[1:])) + 1
    assert frequency[line] == pytest.approx(5.0)
    assert amplitude[line] == pytest.approx(2.5)
    assert amplitude[0] == pytest.approx(0.3)
    assert np.sum(amplitude[1:]) == pytest.approx(2.5, abs=1e-9)


@pytest.mark.parametrize("seconds", [10.0, 9.99])
def test_spectrum_holds_all_the_power(seconds):
    signal = build_signal("rgs", sample_time=0.01, duration=seconds, amplitude=0.7, offset=0.2)
    _, amplitude = signal.spectrum()
    assert amplitude[0] ** 2 + np.sum(amplitude[1:] ** 2) / 2 == pytest.approx(np.mean(signal.value**2))


@pytest.mark.parametrize(
    ("name", "crest"),
    [("square", 1.0), ("sine", math.sqrt(2)), ("triangle", math.sqrt(3)), ("prbs", 1.0), ("zero", 0.0)],
)
def test_crest_factor_of_known_shapes(name, crest):
    signal = build_signal(name, sample_time=0.001, duration=10.0, amplitude=3.0, offset=1.0)
    assert signal.crest_factor == pytest.approx(crest, rel=1e-4)


def test_power_band_of_white_noise_is_its_middle():
    signal = build_signal("rgs", sample_time=0.001, duration=50.0, frequency_max=100.0)
    assert signal.power_band(0.9) == pytest.approx((5.0, 95.0), rel=0.1)
    assert build_signal("constant", sample_time=0.01, duration=1.0).power_band() == (0.0, 0.0)


def test_spectrum_skips_the_ramp_where_whole_periods_remain():
    signal = build_signal("sine", sample_time=0.01, duration=10.0, frequency=1.0, ramp_in=2.0)
    _, amplitude = signal.spectrum()
    assert np.max(amplitude) == pytest.approx(1.0)
    assert signal.duration == pytest.approx(10.0)
