"""Chirps: instantaneous frequency against the closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import chirp

from idloop.signals import build_signal


@pytest.mark.parametrize(("start", "end"), [(0.5, 20.0), (20.0, 0.5), (3.0, 3.0)])
@pytest.mark.parametrize("sweep", ["linear", "logarithmic"])
def test_against_scipy(sweep, start, end):
    signal = build_signal(
        "chirp", sample_time=0.001, duration=10.0, frequency_start=start, frequency_end=end, sweep=sweep
    )
    expected = chirp(signal.time, start, 10.0, end, sweep, phi=-90)
    assert np.allclose(signal.value, expected, atol=1e-9)


def test_sweeps_repeat():
    signal = build_signal("chirp", sample_time=0.01, duration=10.0, sweep_time=2.5, frequency_end=5.0)
    assert signal.period_samples == 250
    assert np.array_equal(signal.value[:250], signal.value[750:])
