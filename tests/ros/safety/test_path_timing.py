"""The pace along a path: soft starts, and always a rest."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.safety.trajectory_gate import AT_REST, PathTiming

timings = st.builds(
    PathTiming, st.floats(0.0, 30.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.05, 5.0)
)  # fmt: skip


def test_from_full_pace_it_takes_the_ramp_to_rest_and_goes_half_as_far():
    one = PathTiming(3.0, 1.0, 0.0, 0.5)
    assert one.until_rest == 0.5
    assert one.at(0.5) == (3.25, 0.0)
    assert one.at(9.0) == (3.25, 0.0)


def test_from_rest_it_speeds_up_goes_on_and_slows_down():
    one = PathTiming(0.0, 0.0, 2.0, 0.5)
    assert one.at(0.25) == (0.0625, 0.5)
    assert one.at(0.5) == (0.25, 1.0)
    assert one.at(2.0) == (1.75, 1.0)
    assert one.at(2.25) == (1.9375, 0.5)
    assert one.at(2.5) == (2.0, 0.0)
    assert one.until_rest == 2.5


def test_from_a_part_of_the_pace_it_rests_sooner():
    assert PathTiming(0.0, 0.5, 0.0, 0.5).until_rest == 0.25
    assert PathTiming(0.0, 0.5, 0.125, 0.5).until_rest == 0.125 + 0.375
    assert PathTiming(0.0, 0.5, 1.0, 0.5).until_rest == 1.5


def test_before_its_instant_it_is_where_it_begins():
    assert PathTiming(3.0, 0.5, 0.2, 0.5).at(-1.0) == (3.0, 0.5)


@given(timings)
def test_it_rests_when_it_says_and_the_pace_never_changes_faster_than_the_ramp(one):
    time = np.linspace(0.0, one.until_rest + 1.0, 400)
    place, pace = one.after(time)
    assert one.at(one.until_rest)[1] == pytest.approx(0.0, abs=1e-9)
    assert np.all((pace >= 0.0) & (pace <= 1.0 + 1e-12))
    step = time[1]
    assert np.max(np.abs(np.diff(pace))) <= step / one.ramp + AT_REST + 1e-9
    # The place is the integral of the pace.
    between = np.diff(place)
    assert np.all(between >= -1e-12)
    assert np.max(np.abs(between - 0.5 * step * (pace[1:] + pace[:-1]))) <= 2.0 * step**2 / one.ramp + 1e-9


@given(timings, st.floats(0.0, 8.0), st.floats(0.0, 8.0))
def test_slowing_down_may_be_taken_up_anywhere(one, first, more):
    """What is slowing down, and is told so again, goes on as before."""
    slow = PathTiming(one.place, one.pace, 0.0, one.ramp)
    again = PathTiming(*slow.at(first), 0.0, one.ramp)
    assert again.at(more) == pytest.approx(slow.at(first + more), abs=1e-9)
