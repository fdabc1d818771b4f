"""Both sides of every limit of a command, and the account of rms and work."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.safety import command_limiter as limiter_module
from idloop_nodes.safety.command_limiter import CommandLimiter, CommandLimits

SECOND = 1_000_000_000
START = 3 * SECOND


def limiter(**limits):
    one = CommandLimiter(CommandLimits(**{"command": 2.0, "soft_start": 0.0} | limits))
    one.start(START)
    return one


def test_what_is_not_said():
    assert CommandLimits(1.0) == CommandLimits(1.0, None, None, 10.0, 10.0, 1.0, 0.05)


def test_before_the_start_nothing_may_stand():
    one = CommandLimiter(CommandLimits(command=2.0, soft_start=0.0))
    assert one.limit(START, 1.0) == 0.0
    assert one.limit(START, 1.0, base=5.0) == 5.0
    assert (one.rms, one.work) == (0.0, 0.0)


@pytest.mark.parametrize("base", [0.0, 1.5])
@pytest.mark.parametrize(
    ("wanted", "passed"), [(1.9, 1.9), (2.0, 2.0), (2.1, 2.0), (-1.9, -1.9), (-2.0, -2.0), (-2.1, -2.0)]
)
def test_size_on_both_sides_of_both_bounds(wanted, passed, base):
    assert limiter().limit(START, base + wanted, base) == pytest.approx(base + passed, abs=1e-12)


@pytest.mark.parametrize("base", [0.0, 1.5])
@pytest.mark.parametrize(
    ("wanted", "passed"), [(0.9, 0.9), (1.1, 1.1), (1.3, 1.2), (0.85, 0.85), (0.75, 0.8), (-2.0, 0.8)]
)
def test_rate_on_both_sides_of_both_bounds(wanted, passed, base):
    one = limiter(rate=2.0)
    one.sent(START, base + 1.0, base)
    assert one.limit(START + SECOND // 10, base + wanted, base) == pytest.approx(base + passed)


def test_the_first_command_of_a_limited_rate_starts_from_the_base():
    assert limiter(rate=2.0).limit(START + SECOND, 1.0) == 0.0
    assert limiter(rate=2.0).limit(START + SECOND, 4.0, base=3.5) == 3.5


def test_a_rate_counts_from_the_last_command_that_was_sent():
    one = limiter(rate=2.0)
    one.sent(START, 0.0)
    one.limit(START + SECOND // 2, 2.0)
    assert one.limit(START + SECOND // 2, 2.0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("after", "opened"), [(-0.1, 0.0), (0.0, 0.0), (0.25, 0.5), (0.5, 1.0), (0.75, 1.5), (1.0, 2.0), (3.0, 2.0)]
)
def test_a_soft_start_opens_from_nothing_to_the_limit(after, opened):
    assert limiter(soft_start=1.0).limit(START + round(after * SECOND), 9.0) == pytest.approx(opened)


@pytest.mark.parametrize(("after", "opened"), [(0.5, 0.5), (1.0, 1.0), (2.0, 2.0)])
def test_a_soft_start_takes_the_time_that_it_is_given(after, opened):
    assert limiter(soft_start=2.0).limit(START + round(after * SECOND), 9.0) == pytest.approx(opened)


def test_nothing_can_widen_a_limit_that_is_set():
    with pytest.raises(FrozenInstanceError):
        limiter().limits.command = 9.0


def test_before_the_first_command_nothing_is_put_to_the_account():
    assert limiter_module.SECOND == SECOND
    one = limiter()
    one.advance(START)
    one.advance(START + SECOND)
    assert (one.rms, one.work) == (0.0, 0.0)
    one.sent(START + SECOND, 2.0)
    one.advance(START + 2 * SECOND)
    assert one.work == 0.0, "nobody has said that it moves"


def test_each_command_is_put_to_the_account_for_as_long_as_it_stood():
    one = limiter(rms_time=0.5, rms=10.0, command=99.0)
    one.sent(START, 2.0)
    one.sent(START + SECOND // 4, 0.0)
    warm = 2.0 * math.sqrt(1.0 - math.exp(-0.5))
    assert one.rms == pytest.approx(warm)
    one.move(START + SECOND // 2, 0.0)
    assert one.rms == pytest.approx(warm * math.exp(-0.25))
    one.limit(START + 3 * SECOND // 4, 0.0)
    assert one.rms == pytest.approx(warm * math.exp(-0.5))


@pytest.mark.parametrize("soft_start", [0.0, -1.0])
def test_without_a_soft_start_everything_is_open(soft_start):
    assert limiter(soft_start=soft_start).limit(START, 9.0) == 2.0


def test_an_rms_is_the_low_pass_filtered_square_of_the_distance():
    one = limiter(rms_time=0.5)
    one.sent(START, 3.0, base=1.0)
    one.advance(START + SECOND // 4)
    assert one.rms == pytest.approx(2.0 * math.sqrt(1.0 - math.exp(-0.5)))
    before = one.rms
    one.advance(START + SECOND // 4)
    assert one.rms == before
    one.sent(START + SECOND // 4, 1.0, base=1.0)
    one.advance(START + SECOND // 2)
    assert one.rms == pytest.approx(before * math.exp(-0.25)), "it cools"


def test_an_rms_at_its_limit_leaves_what_may_stand_for_a_while():
    one = limiter(rms=1.0, rms_time=0.5, standing=0.05, command=50.0)
    keep = math.exp(-0.1)
    assert one.limit(START, 50.0) == pytest.approx(1.0 / math.sqrt(1.0 - keep))
    one.sent(START, 1.0)
    one.advance(START + 100 * SECOND)
    assert one.rms == pytest.approx(1.0)
    assert one.limit(START + 100 * SECOND, 50.0) == pytest.approx(1.0)
    one.sent(START + 100 * SECOND, 3.0)
    one.advance(START + 101 * SECOND)
    assert one.limit(START + 101 * SECOND, 50.0) == 0.0, "too hot for anything"


@pytest.mark.parametrize(("output", "velocity"), [(2.0, 3.0), (-2.0, 3.0), (2.0, -3.0), (-2.0, -3.0)])
@pytest.mark.parametrize("first", ["sent", "move"])
def test_work_counts_whatever_its_sign(output, velocity, first):
    one = limiter(energy_time=0.5)
    if first == "sent":
        one.sent(START, output)
        one.move(START, velocity)
    else:
        one.move(START, velocity)
        one.sent(START, output)
    one.advance(START + SECOND // 4)
    assert one.work == pytest.approx((1.0 - math.exp(-0.5)) * 0.5 * 6.0)
    one.move(START + SECOND // 4, 0.0)
    one.advance(START + SECOND // 2)
    assert one.work == pytest.approx(math.exp(-0.5) * (1.0 - math.exp(-0.5)) * 3.0), "it is forgotten"


def test_the_work_of_a_position_is_that_of_its_distance_from_the_axis():
    one = limiter(energy_time=0.5)
    one.sent(START, 3.0, base=1.0)
    one.move(START, 2.0, base=2.5)
    one.advance(START + SECOND // 4)
    assert one.work == pytest.approx((1.0 - math.exp(-0.5)) * 0.5 * 1.0)
    assert one.rms == pytest.approx(0.5 * math.sqrt(1.0 - math.exp(-0.025)))


def test_an_axis_whose_speed_nobody_knows_does_no_work():
    one = limiter()
    one.sent(START, 1.0)
    one.move(START, math.nan)
    one.advance(START + SECOND)
    assert one.work == 0.0


@given(
    st.lists(st.tuples(st.integers(0, 10**9), st.floats(-1e9, 1e9), st.floats(-10.0, 10.0)), max_size=60),
    st.floats(0.1, 5.0),
    st.floats(0.0, 100.0),
)
def test_whatever_is_wanted_size_and_rate_hold(wishes, command, rate):
    one = limiter(command=command, rate=rate)
    now, before = START, 0.0
    one.sent(now, before)
    for wait, wanted, _ in wishes:
        now += wait
        output = one.limit(now, wanted)
        assert abs(output) <= command
        assert abs(output - before) <= rate * wait / SECOND + 1e-9
        one.sent(now, output)
        before = output
