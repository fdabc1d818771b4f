"""Random steps: levels and hold times."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from idloop.signals import build_signal


@given(
    levels=st.integers(2, 9),
    hold_min=st.integers(1, 20),
    more=st.integers(0, 30),
    seed=st.integers(0, 1000),
)
def test_levels_and_hold_times_stay_in_their_range(levels, hold_min, more, seed):
    signal = build_signal(
        "multilevel",
        sample_time=0.01,
        duration=5.0,
        levels=levels,
        hold_min=0.01 * hold_min,
        hold_max=0.01 * (hold_min + more),
        seed=seed,
    )
    allowed = np.linspace(-1.0, 1.0, levels)
    assert np.all(np.min(np.abs(signal.value[:, None] - allowed), axis=1) < 1e-12)
    edges = np.flatnonzero(np.diff(signal.value)) + 1
    holds = np.diff(np.concatenate([[0], edges]))
    assert np.all((holds >= hold_min) & (holds <= hold_min + more))
    assert [segment.start for segment in signal.segments] == [0, *edges]


def test_free_levels_fill_the_range():
    signal = build_signal("multilevel", sample_time=0.01, duration=300.0, amplitude=2.0, seed=1)
    levels = [signal.value[segment.start] for segment in signal.segments]
    assert len(set(levels)) == len(levels)
    assert min(levels) < -1.9
    assert max(levels) > 1.9
