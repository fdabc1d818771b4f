import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from idloop.validation.operating_state import OperatingState, direction_of, since_reversal
from idloop.validation.stretch import _span, describe, stamp, worst_stretches

TIME = np.arange(0.0, 20.0, 0.01)


def state_of(velocity: np.ndarray | None = None) -> OperatingState:
    """An axis that swings with a period of 10 s unless told otherwise."""
    v = np.sin(0.2 * np.pi * TIME) if velocity is None else velocity
    direction = direction_of(v, 0.02)
    since, _ = since_reversal(TIME, direction)
    return OperatingState("motor", "rad", "V", TIME, 2.0 * v, np.cumsum(v) * 0.01, v, direction, since, 0.02)


def test_bursts_are_found_worst_first_with_their_stamps() -> None:
    error = np.full(len(TIME), 1e-3)
    error[300:340] = 1.0
    error[1500:1520] = 1.0
    first, second = worst_stretches(error, state_of(), 1_700_000_000_500_000_000)[:2]
    assert first.start == pytest.approx(3.0, abs=0.06)
    assert first.stop == pytest.approx(3.39, abs=0.06)
    assert second.start == pytest.approx(15.0, abs=0.06)
    assert first.error == pytest.approx(2 / 3, abs=0.01)
    assert first.start_ns == 1_700_000_000_500_000_000 + round(first.start * 1e9)
    assert f"stamp {stamp(first.start_ns)}" in first.line()
    assert first.to_dict()["start_stamp"].startswith("17000000")
    assert first.stands_out


@given(arrays(float, len(TIME), elements=st.floats(-10.0, 10.0, width=16)))
def test_stretches_are_disjoint_and_hold_what_they_say(error: np.ndarray) -> None:
    found = worst_stretches(error, state_of(), 0)
    assert sum(s.error for s in found) <= 1.0 + 1e-9
    assert sum(s.time for s in found) <= 1.0 + 1e-9
    ordered = sorted(found, key=lambda s: s.start)
    assert all(a.stop < b.start for a, b in itertools.pairwise(ordered))
    assert [s.error for s in found] == sorted((s.error for s in found), reverse=True)
    for s in found:
        inside = (s.start <= TIME) & (s.stop >= TIME)
        assert s.error == pytest.approx(np.sum(error[inside] ** 2) / np.sum(error**2))
        assert s.rms == pytest.approx(np.sqrt(np.mean(error[inside] ** 2)))


def test_a_stretch_ends_at_a_hole() -> None:
    error = np.where((TIME > 4.8) & (TIME < 7.2), 1.0, 1e-3)
    keep = (TIME < 5.0) | (TIME > 7.0)
    found = worst_stretches(error[keep], state_of().at(TIME[keep]), 0)
    assert all(s.stop < 5.0 or s.start > 7.0 for s in found)
    assert {round(s.start, 1) for s in found[:2]} == {4.8, 7.0}


def test_no_error_has_no_worst_stretch() -> None:
    assert worst_stretches(np.zeros(len(TIME)), state_of(), 0) == ()


def test_an_even_error_has_none_that_stands_out() -> None:
    error = np.random.default_rng(0).normal(size=len(TIME))
    assert not any(s.stands_out for s in worst_stretches(error, state_of(), 0))


@pytest.mark.parametrize(
    ("first", "last", "words"),
    (
        (480, 520, "reversing from forward to backward"),
        (20, 120, "moving forward and speeding up"),
        (620, 640, "moving backward"),
        (850, 980, "moving backward and slowing down"),
        (100, 1900, "3 reversals"),
        (498, 502, "standing"),
        (505, 525, "s after a reversal"),
    ),
)
def test_what_the_axis_does(first: int, last: int, words: str) -> None:
    text = describe(state_of(), first, last)
    assert words in text
    assert "rad" in text
    assert text.endswith(" V")


def test_without_a_motion_the_command_is_said() -> None:
    blind = OperatingState("motor", "rad", "V", TIME, np.full(len(TIME), -2.0), None, None, None, None, 0.0)
    assert describe(blind, 10, 20) == "command −2 V"


def test_stamps_are_written_as_ros_does() -> None:
    assert stamp(1_700_000_000_000_000_001) == "1700000000.000000001"
    assert stamp(5) == "0.000000005"


def test_an_end_that_is_nothing_beside_the_other_is_zero() -> None:
    """From −1.76 · 10⁻⁵ to 0.0231 m reads like a finding."""
    assert _span(-1.76e-5, 0.0231) == "0 to 0.0231"
    assert _span(-0.101, 0.0529) == "−0.101 to 0.0529"
    assert _span(4.0, 4.01) == "4"
