"""Ticks of an axis of decades: round numbers, from end to end, never too many."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.reporting.figures.ladder import decade_ticks


def test_ticks_reach_down_to_the_small_errors() -> None:
    assert decade_ticks(0.03, 1.7) == [0.05, 0.1, 0.2, 0.5, 1.0]
    assert decade_ticks(3e-5, 1.7) == [1e-4, 1e-3, 1e-2, 0.1, 1.0]


@given(st.floats(-8.0, 4.0), st.floats(np.log10(5.0), 9.0))
def test_ticks_lie_on_the_axis_and_leave_no_wide_gap(exponent: float, decades: float) -> None:
    low, high = 10.0**exponent, 10.0 ** (exponent + decades)
    ticks = decade_ticks(low, high)
    assert ticks == sorted(set(ticks))
    assert all(low <= tick <= high for tick in ticks)
    assert 1 <= len(ticks) <= 10
    step = 2.5 if decades < 2.5 else 10.0
    assert np.diff(np.log10([low, *ticks, high])) == pytest.approx(0.0, abs=np.log10(step) + 1e-9)
