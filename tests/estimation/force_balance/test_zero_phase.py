import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from idloop.estimation.force_balance.motion import zero_phase


@given(st.integers(0, 999), st.floats(1e-3, 0.44), st.integers(40, 400), st.integers(1, 39), st.integers(1, 3))
def test_it_is_scipys_filter(seed: int, share: float, samples: int, pad: int, columns: int) -> None:
    walk = np.cumsum(np.random.default_rng(seed).normal(size=(samples, columns)), axis=0)
    sections = butter(4, share, fs=1.0, output="sos")
    expected = sosfiltfilt(sections, walk, axis=0, padlen=pad)
    size = float(np.max(np.abs(walk)))
    kept = walk.copy()
    assert zero_phase(walk, share, 1.0, pad) == pytest.approx(expected, abs=1e-9 * size)
    assert zero_phase(walk[:, 0], share * 500.0, 2e-3, pad) == pytest.approx(expected[:, 0], abs=1e-9 * size)
    assert np.array_equal(walk, kept)
