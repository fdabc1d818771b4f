"""Random Gaussian signals: moments, band, distribution."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from idloop.signals import build_signal


@given(
    samples=st.integers(50, 3000),
    low=st.floats(0.0, 5.0),
    width=st.floats(10.0, 40.0),
    seed=st.integers(0, 1000),
)
def test_variance_mean_and_band_are_exact(samples, low, width, seed):
    signal = build_signal(
        "rgs",
        sample_time=0.01,
        duration=samples * 0.01,
        amplitude=2.0,
        frequency_min=low,
        frequency_max=low + width,
        seed=seed,
    )
    assert np.mean(signal.value) == pytest.approx(0.0, abs=1e-9)
    assert np.std(signal.value) == pytest.approx(2.0)
    frequency, amplitude = signal.spectrum()
    outside = (frequency < low - 1e-6) | (frequency > low + width + 1e-6)
    assert np.allclose(amplitude[outside], 0.0, atol=1e-9)


def test_samples_are_gaussian():
    # Independent samples are needed for the test's level: one from each of many seeds.
    drawn = [
        build_signal("rgs", sample_time=0.001, duration=0.5, frequency_max=50.0, seed=s).value[100] for s in range(400)
    ]
    assert kstest(drawn, "norm").pvalue > 0.01
