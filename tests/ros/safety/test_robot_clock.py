"""What a robot is told is stamped in the clock of what it measures."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from hypothesis import given
from hypothesis import strategies as st

from idloop_nodes.safety.robot_joints import PLAUSIBLE_NS, STRETCH_NS, RobotClock
from idloop_nodes.streams.stream_watch import JUMP_NS

NOW = 1_800_000_000 * 10**9
MS = 1_000_000


def test_a_robot_without_stamps_or_before_its_first_has_our_clock():
    clock = RobotClock()
    assert clock.stamp(NOW) == NOW
    clock.update(0, NOW + 5)
    assert clock.stamp(NOW + 10) == NOW + 10


@given(st.lists(st.integers(0, PLAUSIBLE_NS), min_size=1, max_size=30))
def test_one_that_stamps_with_our_clock_leaves_ours_as_it_is(delays):
    clock = RobotClock()
    for k, delay in enumerate(delays):
        clock.update(NOW + k * 10 * MS - delay, NOW + k * 10 * MS)
    assert clock.is_ours
    assert clock.stamp(NOW + 10**9) == NOW + 10**9


@given(
    offset=st.integers(-(10**15), 10**15).filter(lambda one: not -4 * MS <= one <= PLAUSIBLE_NS),
    delays=st.lists(st.integers(0, 4 * MS), min_size=1, max_size=30),
)
def test_a_command_lies_in_the_robots_clock_up_to_the_least_delay(offset, delays):
    clock = RobotClock()
    for k, delay in enumerate(delays):
        now = NOW + k * 10 * MS
        clock.update(now - offset - delay, now)
    now = NOW + len(delays) * 10 * MS
    robots = now - offset
    assert robots - clock.stamp(now) == min(delays)


@given(st.lists(st.integers(0, 400 * MS), min_size=2, max_size=50))
def test_stamps_never_go_back_while_the_estimate_changes(delays):
    clock, said = RobotClock(), 0
    for k, delay in enumerate(delays):
        now = NOW + k * MS
        clock.update(now - 10**10 - delay, now)
        stamp = clock.stamp(now)
        assert stamp > said
        said = stamp


def test_a_clock_that_drifts_is_followed_and_one_that_was_set_at_once():
    clock = RobotClock()
    for k in range(60):
        now = NOW + k * STRETCH_NS // 2
        clock.update(now - 10**11 - k * MS, now)
    assert clock.behind >= 10**11 + 55 * MS
    clock.update(NOW + 10**13 - 7 * JUMP_NS, NOW + 10**13)
    assert clock.behind == 7 * JUMP_NS
