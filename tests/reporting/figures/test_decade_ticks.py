"""Ticks of an axis of decades: round numbers, from end to end, never too many."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from bokeh.models.annotations import Label

from idloop.reporting.figures.ladder import decade_ticks, name_rows, number_decades
from idloop.reporting.figures.theme import LIGHT, new_figure


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


def test_an_axis_of_two_decades_has_few_whole_numbers() -> None:
    plot = new_figure(LIGHT, ("frequency", "Hz"), ("coherence", "-"), x_axis_type="log")
    number_decades(plot, 1.4, 98.0)
    assert [plot.xaxis[0].major_label_overrides[tick] for tick in plot.xaxis[0].ticker.ticks] == [
        "2", "5", "10", "20", "50",
    ]  # fmt: skip


def test_names_of_rows_hide_the_grid_behind_them_and_the_last_row_has_room() -> None:
    plot = new_figure(LIGHT, ("error", "-"), ("", None))
    places = name_rows(plot, ["start", "friction"], LIGHT, 0.7)
    assert plot.y_range.start == pytest.approx(places[-1] - 0.7)
    assert {one.background_fill_color for one in plot.select(Label)} == {LIGHT.surface}


def test_small_numbers_of_an_axis_are_written_as_they_are() -> None:
    plot = new_figure(LIGHT, ("time", "s"), ("force", "N"))
    assert plot.yaxis[0].formatter.power_limit_low == -5
