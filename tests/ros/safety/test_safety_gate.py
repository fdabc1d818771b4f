"""Both sides of every limit of the gate, and when it stops, holds, latches and lets go."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.excitation.experiment import Limits
from idloop_nodes.safety.command_limiter import CommandLimits
from idloop_nodes.safety.interlock import AFTER_END_NS, CREDIBLE
from idloop_nodes.safety.safety_gate import GateSettings, SafetyGate
from idloop_nodes.streams.stream_watch import JUMP_NS

MS = 1_000_000
SECOND = 1000 * MS


class Driver:
    """A gate with its time; every call is 5 ms after the last unless told otherwise."""

    def __init__(self, *, active=True, motion=None, command=2.0, soft_start=0.0, rms=None, **more):
        limits = CommandLimits(command=command, soft_start=soft_start, rms=rms)
        self.gate = SafetyGate(GateSettings(limits, motion=motion or Limits(), **more))
        self.now = 10 * SECOND
        if active:
            self.gate.activate()

    def measure(self, position=0.0, velocity=0.0, after=5 * MS, stamp=None):
        self.now += after
        return self.gate.measure(self.now, self.now if stamp is None else stamp, position, velocity)

    def command(self, value, after=5 * MS, stamp=None):
        self.now += after
        return self.gate.command(self.now, self.now if stamp is None else stamp, value)

    def tick(self, after=5 * MS):
        self.now += after
        return self.gate.tick(self.now)

    def driving(self, value=1.0, position=0.0, velocity=0.0):
        self.measure(position, velocity)
        assert self.command(value) == value
        return self


POSITION = {"neutral": "hold_measured", "motion": Limits(None, -3.0, 4.0, None)}


@pytest.mark.parametrize(
    ("wanted", "position", "passed"),
    [
        (3.9, 3.0, 3.9), (4.0, 3.0, 4.0), (5.0, 3.5, 4.0),
        (-2.9, -2.0, -2.9), (-3.0, -2.0, -3.0), (-4.0, -2.5, -3.0),
    ],
)  # fmt: skip
def test_a_commanded_position_on_both_sides_of_both_limits(wanted, position, passed):
    one = Driver(**POSITION)
    one.measure(position)
    assert one.command(wanted) == passed


@pytest.mark.parametrize(
    ("motion", "wanted", "passed"),
    [(Limits(None, None, 4.0, None), -9.0, -2.0), (Limits(None, -3.0, None, None), 9.0, 2.0)],
)
def test_a_position_without_one_of_its_limits(motion, wanted, passed):
    one = Driver(neutral="hold_measured", motion=motion)
    one.measure(0.0)
    assert one.command(wanted) == passed


def test_an_effort_has_nothing_to_do_with_the_limits_of_the_position():
    one = Driver(motion=Limits(None, -0.5, 0.5, None), command=9.0)
    one.measure(0.0)
    assert one.command(7.0) == 7.0
    assert one.command(-7.0) == -7.0


@pytest.mark.parametrize("held", [4.5, -3.5])
def test_a_position_that_is_held_is_inside_the_limits_too(held):
    one = Driver(**POSITION)
    one.measure(held)
    assert one.tick() == max(min(held, 4.0), -3.0)


@pytest.mark.parametrize(
    ("state", "breach"),
    [
        ((1.0, 0.0), ""),
        ((1.001, 0.0), "position 1.001 is above limit.position_max 1"),
        ((-1.0, 0.0), ""),
        ((-1.001, 0.0), "position -1.001 is below limit.position_min -1"),
        ((0.0, 3.0), ""),
        ((0.0, 3.001), "velocity 3.001 is beyond limit.velocity 3"),
        ((0.0, -3.0), ""),
        ((0.0, -3.001), "velocity -3.001 is beyond limit.velocity 3"),
    ],
)
def test_position_and_velocity_on_both_sides_of_every_limit(state, breach):
    one = Driver(motion=Limits(None, -1.0, 1.0, 3.0)).driving()
    assert one.measure(*state) == (0.0 if breach else None)
    assert one.gate.latched == breach
    assert one.gate.reason == breach
    assert one.command(1.0) == (0.0 if breach else 1.0)


@pytest.mark.parametrize(
    ("state", "stops"), [((0.5, 2.5), False), ((0.5, 2.51), True), ((-0.5, -2.5), False), ((-0.5, -2.51), True)]
)
def test_where_the_axis_would_coast_to_on_both_sides(state, stops):
    one = Driver(motion=Limits(None, -1.0, 1.0, None), coast_time=0.2).driving()
    one.measure(*state)
    assert one.gate.latched.startswith("coasting to position") is stops


def test_without_a_coast_time_nothing_is_foretold():
    one = Driver(motion=Limits(None, -1.0, 1.0, None)).driving()
    assert one.measure(0.9, 1e6) is None


@pytest.mark.parametrize(("energy", "stops"), [(1.0, False), (1.0 - 1e-6, True), (None, False)])
def test_work_on_both_sides_of_its_limit(energy, stops):
    one = Driver(energy=energy).driving(2.0, velocity=1.0)
    one.gate.limiter.advance(one.now)
    one.gate.limiter.work = 1.0
    one.measure(velocity=0.0, after=0, stamp=one.now + 1)
    assert bool(one.gate.latched) is stops
    if stops:
        assert one.gate.latched == "work is more than limit.energy 1"


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("field", ["position", "velocity"])
def test_what_is_measured_is_credible_up_to_a_bound(field, sign):
    one = Driver().driving()
    state = {"position": 0.0, "velocity": 0.0}
    assert one.measure(**state | {field: sign * CREDIBLE}) is None
    assert one.measure(**state | {field: sign * CREDIBLE * 1.001}) == 0.0
    assert one.gate.reason == f"the {field} is not finite"
    assert CREDIBLE == 1e100


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("where", ["command", "position", "velocity"])
def test_what_is_not_finite_stops_the_motor_and_the_next_good_one_lets_it_go(value, where):
    one = Driver().driving()
    if where == "command":
        assert one.command(value) == 0.0
    else:
        assert one.measure(**{"position": 0.0, "velocity": 0.0} | {where: value}) == 0.0
    assert one.gate.reason == f"the {where} is not finite"
    one.driving(-1.0)
    assert one.gate.reason == ""
    assert one.gate.faults == 1


def test_the_largest_finite_command_is_one():
    assert Driver(command=1.7e308).driving(1.7e308).gate.reason == ""


def test_a_measurement_that_is_not_finite_is_not_taken_for_where_the_axis_is():
    one = Driver(**POSITION)
    one.measure(1.0)
    one.measure(math.nan)
    assert one.tick() == 1.0


def test_a_robot_that_does_not_measure_a_field_is_not_asked_for_it():
    one = Driver(motion=Limits(None, -1.0, 1.0, 3.0), coast_time=0.1)
    one.gate.measure(one.now, one.now, None, 1.0)
    assert one.command(1.0) == 1.0
    one.gate.measure(one.now + MS, one.now + MS, None, 3.1)
    assert one.gate.latched.startswith("velocity")


def test_a_speed_that_is_not_measured_is_that_of_the_positions_by_their_stamps():
    one = Driver(motion=Limits(None, None, None, 3.0))
    for step in range(30):
        one.measure(0.01 * step, None, stamp=SECOND + step * 5 * MS)
    assert one.gate.latched == ""
    for step in range(30):
        one.measure(0.3 + 0.02 * step, None, stamp=2 * SECOND - 849 * MS + step * 5 * MS)
    assert one.gate.latched.startswith("velocity")


def test_a_speed_of_positions_without_stamps_is_by_their_arrival():
    one = Driver(motion=Limits(None, None, None, 3.0))
    for step in range(30):
        one.measure(0.01 * step, None, stamp=0)
    assert one.gate.latched == ""
    for step in range(30):
        one.measure(0.3 + 0.02 * step, None, stamp=0)
    assert one.gate.latched.startswith("velocity")


def test_a_jump_of_the_clock_is_no_speed():
    one = Driver(motion=Limits(None, None, None, 3.0))
    for step in range(30):
        one.measure(0.0, None, stamp=5 * SECOND + step * 5 * MS)
    for step in range(30):
        one.measure(100.0, None, stamp=5 * SECOND + 2 * JUMP_NS + step * 5 * MS)
    assert one.gate.latched == ""


@pytest.mark.parametrize("stream", ["measurement", "command"])
def test_a_jump_stops_the_motor_once(stream):
    one = Driver().driving()
    stamp = one.now + 2 * JUMP_NS
    output = one.measure(stamp=stamp) if stream == "measurement" else one.command(1.0, stamp=stamp)
    assert output == 0.0
    assert one.gate.reason == f"the clock of the {stream} jumped"


@pytest.mark.parametrize("stream", ["measurement", "command"])
def test_what_is_stale_is_not_looked_at(stream):
    one = Driver().driving()
    stamp = one.now if stream == "command" else one.now - 5 * MS
    bad = math.nan
    output = one.measure(bad, stamp=stamp) if stream == "measurement" else one.command(bad, stamp=stamp)
    assert output is None
    assert one.gate.reason == ""


@pytest.mark.parametrize(("after", "stops"), [(35 * MS, False), (36 * MS, True)])
def test_the_watchdog_of_the_measurement_on_both_sides(after, stops):
    one = Driver().driving()  # measured 5 ms before it was commanded
    assert one.tick(after) == (0.0 if stops else None)
    assert one.gate.reason == ("no measurement for 0.04 s" if stops else "")


@pytest.mark.parametrize(("after", "stops"), [(35 * MS, False), (36 * MS, True)])
def test_the_watchdog_of_the_command_on_both_sides(after, stops):
    one = Driver().driving()
    one.measure()
    assert one.tick(after) == (0.0 if stops else None)
    assert one.gate.reason == ("no command for 0.04 s" if stops else "")


def test_nothing_passes_before_both_streams_have_spoken():
    one = Driver()
    assert one.tick() == 0.0
    assert one.gate.reason == "no measurement yet"
    assert one.command(1.0) == 0.0
    assert one.gate.reason == "no measurement yet"
    other = Driver()
    other.measure()
    other.tick()
    assert other.gate.reason == "no command yet"
    assert other.gate.faults == 0, "nothing was driven"


def test_a_measurement_sends_nothing_but_a_stop():
    one = Driver().driving()
    assert one.measure() is None
    one.gate.forbid("test", "said so")
    assert one.measure() == 0.0
    assert one.measure() is None, "the stop was sent; the tick repeats it"
    assert one.tick() == 0.0


def test_a_tick_repeats_what_is_neutral_and_nothing_else():
    one = Driver().driving()
    assert one.tick() is None
    one.gate.stop(one.now)
    assert [one.tick(), one.tick()] == [0.0, 0.0]


def test_a_tick_sends_what_the_limits_now_give():
    one = Driver(soft_start=1.0)
    one.measure()
    assert one.command(2.0) == 0.0
    for _ in range(3):
        one.measure(after=0, stamp=one.now + 1)
        assert one.tick() > 0.0


def test_each_source_forbids_for_itself():
    one = Driver().driving()
    one.gate.forbid("guardian", "the guardian is gone")
    one.gate.forbid("rivals", "others publish")
    assert one.gate.forbidden == "the guardian is gone"
    assert one.command(1.0) == 0.0
    one.gate.forbid("guardian", "")
    assert one.gate.forbidden == "others publish"
    assert one.command(1.0) == 0.0
    one.gate.forbid("rivals", "")
    assert one.gate.forbidden == ""
    assert one.driving().gate.faults == 1


def test_what_is_forbidden_is_not_latched():
    one = Driver(latch_watchdog=True).driving()
    one.gate.forbid("guardian", "gone")
    one.tick()
    assert one.gate.latched == ""


@pytest.mark.parametrize("latch", [True, False])
def test_what_the_watchdog_found_is_latched_where_that_is_wanted(latch):
    one = Driver(latch_watchdog=latch).driving()
    one.tick(50 * MS)
    assert one.gate.latched == ("no measurement for 0.04 s" if latch else "")
    one.measure()
    assert one.command(1.0) == (0.0 if latch else 1.0)
    assert one.gate.reset() == ""
    one.driving()


def test_an_emergency_stop_is_latched_until_reset():
    one = Driver().driving()
    assert one.gate.stop(one.now) == 0.0
    assert one.gate.latched == one.gate.reason == "emergency stop"
    one.gate.deactivate(one.now)
    one.gate.activate()
    one.measure()
    assert one.command(1.0) == 0.0
    assert one.gate.reset() == ""
    assert one.gate.latched == ""
    one.driving()


def test_a_reset_is_refused_while_the_breach_holds():
    one = Driver(motion=Limits(None, None, 1.0, None)).driving()
    one.measure(1.5)
    assert one.gate.reset() == "position 1.5 is above limit.position_max 1"
    assert one.gate.latched
    one.measure(0.5)
    assert one.gate.reset() == ""
    one.driving()


def test_an_inactive_gate_says_neutral_for_its_farewell_and_then_nothing():
    assert AFTER_END_NS == SECOND // 2
    one = Driver(active=False)
    assert (one.gate.active, one.gate.reason, one.gate.faults, one.gate.limited) == (False, "inactive", 0, 0)
    assert one.tick() is None
    assert one.gate.neutral_command(one.now) is None, "it never had the motor"
    assert one.gate.deactivate(one.now) is None
    one.gate.activate()
    one.driving()
    assert one.gate.neutral_command(one.now) == 0.0
    left = one.now
    assert one.gate.deactivate(left) == 0.0
    assert one.gate.faults == 0, "an order is no fault"
    assert one.gate.deactivate(left + MS) == 0.0
    one.now = left
    assert one.tick(AFTER_END_NS) == 0.0
    assert one.gate.neutral_command(one.now) == 0.0
    assert one.tick(1) is None
    assert one.gate.neutral_command(one.now) is None


def test_a_second_farewell_does_not_begin_anew():
    one = Driver().driving()
    left = one.now
    one.gate.deactivate(left)
    one.gate.deactivate(left + AFTER_END_NS)
    assert one.gate.neutral_command(left + AFTER_END_NS + 1) is None


def test_activation_waits_for_the_next_command():
    one = Driver().driving()
    one.gate.deactivate(one.now)
    one.gate.activate()
    assert one.gate.reason == "inactive", "as it was decided last"
    one.driving()


def test_a_soft_start_begins_anew_with_every_stop_and_not_in_between():
    one = Driver(soft_start=0.1)
    one.measure()
    outputs = []
    for _ in range(30):
        one.measure(after=0, stamp=one.now + 1)
        outputs.append(one.command(2.0))
    assert outputs[0] == 0.0
    assert outputs[10] == pytest.approx(1.0)
    assert outputs[-1] == 2.0
    one.command(math.nan)
    one.measure()
    assert one.command(2.0) == 0.0
    one.measure(after=0, stamp=one.now + 1)
    assert one.command(2.0) == pytest.approx(0.1)


def test_commands_that_a_limit_changed_are_counted():
    one = Driver()
    one.measure()
    one.command(2.0)
    assert one.gate.limited == 0
    one.command(2.1)
    assert one.gate.limited == 1


def test_faults_are_stops_of_commands_that_passed():
    one = Driver().driving()
    for _ in range(3):
        one.command(math.nan)
    assert one.gate.faults == 1
    one.driving()
    one.command(math.nan)
    assert one.gate.faults == 2


def test_what_was_sent_is_put_to_the_account():
    one = Driver(rms=1.0).driving(1.0)
    one.measure(velocity=2.0)
    one.measure(velocity=2.0)
    assert one.gate.limiter.rms > 0.0
    assert one.gate.limiter.work > 0.0


# A position


def test_a_position_is_held_where_the_axis_was_when_the_fault_came():
    one = Driver(**POSITION)
    assert one.tick() is None, "nobody knows where it is"
    assert one.gate.neutral_command(one.now) is None
    one.driving(1.0, position=0.5)
    assert one.gate.neutral_command(one.now) == 0.5
    assert one.gate.stop(one.now) == 0.5
    one.measure(0.8)
    assert one.tick() == 0.5, "it does not give way"
    assert one.gate.neutral_command(one.now) == 0.5
    one.gate.reset()
    one.driving(1.0, position=0.9)
    assert one.gate.stop(one.now) == 0.9


def test_a_new_activation_holds_where_the_axis_is_then():
    one = Driver(**POSITION).driving(1.0, position=0.5)
    one.gate.deactivate(one.now)
    one.gate.activate()
    one.gate.stop(one.now)
    one.measure(1.5)
    assert one.tick() == 0.5
    one.gate.deactivate(one.now)
    one.gate.activate()
    assert one.tick() == 1.5


def test_a_position_may_be_held_where_it_was_commanded():
    one = Driver(neutral="hold_command", motion=Limits(None, -3.0, 4.0, None))
    one.measure(0.5)
    assert one.tick() == 0.5, "nothing was commanded yet"
    one.driving(1.0, position=0.75)
    assert one.gate.stop(one.now) == 1.0


def test_the_rms_of_a_position_is_that_of_its_distance():
    one = Driver(**POSITION).driving(1.0, position=1.0)
    one.measure(1.0)
    one.measure(1.0)
    assert one.gate.limiter.rms == 0.0
    other = Driver().driving(1.0, position=1.0)
    other.measure(1.0)
    assert other.gate.limiter.rms > 0.0
