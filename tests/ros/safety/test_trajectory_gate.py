"""A planned motion through the gate, in simulated time: what the arm is told, fault by fault.

The arm follows what it is told exactly, through the same rules as a joint_trajectory_controller.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from trajectory_follower import Follower

from idloop.errors import InputError
from idloop.robots.joint_limits import JointLimits
from idloop.robots.joint_path import JointPath
from idloop_nodes.codec import TrajectoryPoint
from idloop_nodes.safety.interlock import AFTER_END_NS
from idloop_nodes.safety.trajectory_gate import REST, STEP, UNNOTICED, TrajectoryGate, TrajectorySettings
from idloop_nodes.streams.stream_watch import JUMP_NS

MS = 1_000_000
SECOND = 1000 * MS
JOINTS = ("shoulder", "elbow")
ACCELERATION, STOP_TIME, HORIZON, WATCHDOG = 8.0, 0.4, 0.1, 0.05
TIME = np.linspace(0.0, 4.0, 201)
PLACE = np.outer(1.0 - np.cos(np.pi * TIME), [0.5, -0.25])
SPEED = np.pi * np.outer(np.sin(np.pi * TIME), [0.5, -0.25])
TICK = 5 * MS


def allowed(**more):
    ends = (np.array([one, one]) for one in (-1.0, 1.2, 2.0, 30.0, ACCELERATION))
    common = {"following_error": 0.1, "approach": 0.3, "stop_time": STOP_TIME, "horizon": HORIZON, "watchdog": WATCHDOG}
    return TrajectorySettings(JointLimits(JOINTS, *ends), **(common | more))


class Run:
    """A gate, an arm and their time; the arm measures and the gate ticks every 5 ms unless told otherwise."""

    def __init__(self, start=(0.0, 0.0), *, active=True, **more):
        self.gate = TrajectoryGate(JointPath(JOINTS, TIME, PLACE, SPEED), allowed(**more))
        self.now = 10 * SECOND
        self.arm = Follower(JOINTS, np.array(start))
        self.told, self.sent = [], []
        if active:
            self.gate.activate()

    def give(self, piece, stamp=None):
        """Take a piece to the arm."""
        if piece is None:
            return
        self.sent.append(self.now)
        rows = zip(piece.time, piece.position, piece.velocity, strict=True)
        points = tuple(TrajectoryPoint(round(float(t) * SECOND), tuple(q), tuple(v)) for t, q, v in rows)
        self.arm.take(self.now, self.now if stamp is None else stamp, JOINTS, points)

    def measure(self, *, off=(0.0, 0.0), velocity=None, effort=(0.0, 0.0), stamp=None):
        place, speed = self.arm.at(self.now)
        stamp = self.now if stamp is None else stamp
        speed = speed if velocity is None else velocity
        self.give(self.gate.measure(self.now, stamp, tuple(place + np.array(off)), tuple(speed), effort))

    def go(self, seconds, *, measured=True, alive=True, **state):
        """Let time pass."""
        for _ in range(round(seconds * SECOND / TICK)):
            self.now += TICK
            if measured:
                self.measure(**state)
            if alive:
                self.give(self.gate.tick(self.now))
            self.told.append(np.concatenate(self.arm.at(self.now)))
        return self

    def finish(self, seconds):
        """Let time pass until the motion has ended, no longer than so long."""
        while seconds > 0.0 and not (self.gate.share_done == 1.0 and self.speed == 0.0):
            self.go(0.2)
            seconds -= 0.2
        return self.go(0.2)

    @property
    def speed(self):
        found = float(np.max(np.abs(self.told[-1][2:])))
        return found if found > 1e-9 else 0.0

    def moving(self):
        """In the middle of the motion, at full pace."""
        self.go(2.5)
        assert self.speed > 0.5
        assert not self.gate.reason
        return self

    def within_acceleration(self):
        """Whether what the arm was told never changed faster than allowed."""
        change = np.abs(np.diff(np.array(self.told)[:, 2:], axis=0)) / (TICK / SECOND)
        return float(np.max(change)) <= ACCELERATION * 1.001

    def on_path(self):
        """Distance of where the arm is told to be from the line of the path, which is straight here."""
        place = np.array(self.told)[:, :2]
        return float(np.max(np.abs(place[:, 1] + 0.5 * place[:, 0])))


def test_the_whole_motion_is_told_as_planned_and_ends_at_rest():
    one = Run().go(8.0)
    assert one.gate.share_done == 1.0
    assert one.speed == 0.0
    told = np.array(one.told)
    assert np.max(told[:, 0]) == pytest.approx(1.0, abs=1e-5)
    assert np.max(np.abs(told[:, 2])) == pytest.approx(0.5 * np.pi, rel=1e-3)
    np.testing.assert_allclose(told[-1], 0.0, atol=1e-9)
    assert one.within_acceleration()
    assert one.on_path() < 1e-5
    assert one.arm.refused == 0
    assert np.max(np.diff(one.sent)) <= 2 * STEP * SECOND


def test_it_starts_softly():
    one = Run().go(STOP_TIME + 0.5)  # the line to the beginning, of no length here, takes the stop time
    planned = np.interp(0.5, TIME, PLACE[:, 0])
    assert 0.0 < one.told[-1][0] < planned


def test_every_piece_ends_at_rest_and_stays_there():
    one = Run().moving()
    piece = one.gate.tick(one.now + round(STEP * SECOND))
    assert piece.time[-1] == pytest.approx(HORIZON + STOP_TIME + REST)
    assert not np.any(piece.velocity[-2:])
    assert np.array_equal(piece.position[-2], piece.position[-1])
    assert np.all(np.diff(piece.time) > 0.0)


def test_when_the_gate_is_gone_the_arm_rests_on_its_path_after_horizon_and_stop_time():
    one = Run().moving()
    one.go(HORIZON + STOP_TIME - 0.05, alive=False)
    assert one.speed > 0.0
    one.go(0.05 + STEP, alive=False)
    assert one.speed == 0.0
    assert one.on_path() < 1e-5
    assert one.within_acceleration()


@pytest.mark.parametrize("silence", [0.01, 0.03, UNNOTICED])
def test_what_the_guardian_sends_stops_it_without_a_jump(silence):
    one = Run().moving()
    beat = one.now
    piece = one.gate.neutral_command(beat)
    one.go(silence, alive=False)
    one.give(piece, stamp=beat)
    one.go(UNNOTICED + STOP_TIME - silence, alive=False)
    assert one.speed == 0.0
    assert one.within_acceleration()
    assert one.on_path() < 1e-5


def test_after_the_guardian_has_stopped_it_the_motion_goes_on_from_there():
    one = Run().moving()
    one.give(one.gate.neutral_command(one.now))
    one.go(0.5 * STOP_TIME, alive=False)  # the bridge hangs
    one.gate.handed_over()
    one.go(8.0)
    assert one.gate.share_done == 1.0
    assert one.within_acceleration()


def test_a_silent_robot_is_stopped_after_watchdog_and_stop_time_and_goes_on_when_it_is_back():
    one = Run().moving()
    one.go(WATCHDOG, measured=False)
    assert not one.gate.reason
    one.go(STOP_TIME + 2 * TICK / SECOND, measured=False)
    assert one.gate.reason == f"no measurement for {WATCHDOG:g} s"
    assert one.speed == 0.0
    where = one.gate.share_done
    one.go(8.0)
    assert one.gate.share_done == 1.0 > where
    assert one.gate.faults == 1
    assert one.within_acceleration()
    assert one.on_path() < 1e-5


def test_with_a_latch_a_silence_stays():
    one = Run(latch_watchdog=True).moving().go(0.2, measured=False).go(1.0)
    assert one.gate.latched == f"no measurement for {WATCHDOG:g} s"
    assert one.speed == 0.0
    assert one.gate.reset() == ""
    assert one.go(0.2).speed > 0.0


@pytest.mark.parametrize(
    ("state", "said"),
    [
        ({"off": (math.nan, 0.0)}, "the position of shoulder is not finite"),
        ({"off": (0.0, math.inf)}, "the position of elbow is not finite"),
    ],
)
def test_what_is_not_finite_stops_it_and_the_next_good_one_lets_it_go(state, said):
    one = Run().moving().go(TICK / SECOND, **state)
    assert one.gate.reason == said
    one.go(STOP_TIME, **state)
    assert one.speed == 0.0
    assert one.go(0.2).speed > 0.0
    assert one.within_acceleration()
    assert one.on_path() < 1e-5


def test_a_clock_that_is_set_stops_it_for_a_message():
    one = Run().moving()
    one.go(TICK / SECOND, stamp=one.now + TICK + JUMP_NS)
    assert one.gate.reason == "the clock of the measurement jumped"
    slower = one.go(STEP, stamp=None, measured=False).speed
    assert slower < 0.99 * np.max(np.abs(one.told[-6][2:]))
    assert one.within_acceleration()


@pytest.mark.parametrize(
    ("state", "said"),
    [
        ({"velocity": (2.001, 0.0)}, "velocity 2.001 of shoulder is beyond 2"),
        ({"effort": (0.0, -30.01)}, "effort -30.01 of elbow is beyond 30"),
    ],
)
def test_a_breach_of_a_limit_stops_it_until_reset(state, said):
    one = Run().moving().go(TICK / SECOND, **state)
    assert one.gate.latched == said
    assert one.gate.reset() == said, "it still holds"
    one.go(STOP_TIME)
    assert one.speed == 0.0
    assert one.gate.reset() == ""
    one.go(8.0)
    assert one.gate.share_done == 1.0
    assert one.within_acceleration()
    assert one.on_path() < 1e-5


def test_measured_velocity_and_effort_may_be_absent():
    nothing = (math.nan, math.nan)
    assert Run().go(8.0, velocity=nothing, effort=nothing).gate.share_done == 1.0


@pytest.mark.parametrize(("off", "stops"), [(0.0999, False), (0.1001, True)])
def test_an_arm_that_does_not_follow_is_stopped_where_it_is(off, stops):
    one = Run().moving()
    place, speed = one.arm.at(one.now + TICK)
    one.go(TICK / SECOND, off=(0.0, off))
    assert bool(one.gate.latched) is stops
    if stops:
        assert one.gate.latched == "elbow is 0.1001 away from the trajectory"
        piece = one.gate.neutral_command(one.now)
        np.testing.assert_allclose(piece.position[0], place + np.array([0.0, off]), atol=0.01)
        rest = place + np.array([0.0, off]) + 0.5 * STOP_TIME * speed
        np.testing.assert_allclose(piece.position[-1], rest, atol=0.02)
        change = np.abs(np.diff(piece.velocity[:-1], axis=0)) / np.diff(piece.time[:-1])[:, None]
        assert np.max(change) <= ACCELERATION


def test_after_it_has_left_its_path_it_begins_anew_from_where_it_is():
    one = Run().go(2.0).go(TICK / SECOND, off=(0.0, 0.2))  # far from the beginning
    one.go(1.0)
    assert one.speed == 0.0
    before = len(one.sent)
    one.go(1.0)
    assert len(one.sent) == before, "an arm at rest is left alone, wherever others move it"
    assert one.gate.reset() == ""
    one.go(STEP)
    assert "away from the beginning of the trajectory, more than approach 0.3: bring it there" in one.gate.reason
    one.arm = Follower(JOINTS, np.zeros(2))  # brought there by hand
    one.told.clear()
    one.go(8.0)
    assert one.gate.share_done == 1.0
    assert one.within_acceleration()


@pytest.mark.parametrize(("away", "goes"), [(0.299, True), (0.301, False)])
def test_the_beginning_is_approached_from_as_far_as_allowed(away, goes):
    one = Run(start=(-away, 0.0)).go(0.5)
    assert (one.speed > 0.0) is goes
    assert bool(one.gate.reason) is not goes
    if not goes:
        assert not one.sent
        return
    one.go(12.0)
    assert one.gate.share_done == 1.0
    assert one.within_acceleration()


def test_an_emergency_stop_is_at_once_and_a_reset_goes_on():
    one = Run().moving()
    one.give(one.gate.stop(one.now))
    one.go(STOP_TIME)
    assert one.speed == 0.0
    assert one.gate.reason == "emergency stop"
    assert one.go(1.0).speed == 0.0
    assert one.gate.reset() == ""
    one.go(8.0)
    assert one.gate.share_done == 1.0
    assert one.within_acceleration()
    assert one.on_path() < 1e-5


def test_deactivated_it_stops_and_then_the_arm_belongs_to_others():
    one = Run().moving()
    one.give(one.gate.deactivate(one.now))
    one.go(STOP_TIME)
    assert one.speed == 0.0
    assert one.gate.neutral_command(one.now) is None
    one.go(AFTER_END_NS / SECOND)
    before = len(one.sent)
    one.arm = Follower(JOINTS, np.array([0.05, 0.02]))  # another controller moves it
    one.go(1.0)
    assert not one.gate.latched
    assert len(one.sent) == before
    one.gate.activate()
    one.told.clear()
    one.go(9.0)
    assert one.gate.share_done == 1.0
    assert one.within_acceleration()


def test_inactive_nothing_is_sent():
    assert not Run(active=False).go(1.0).sent


def test_before_the_first_measurement_nothing_is_sent():
    one = Run().go(1.0, measured=False)
    assert not one.sent
    assert one.gate.reason == "no measurement yet"


def test_what_is_forbidden_stops_it():
    one = Run().moving()
    one.gate.forbid("rivals", "others publish")
    one.go(STOP_TIME + TICK / SECOND)
    assert (one.speed, one.gate.reason) == (0.0, "others publish")
    one.gate.forbid("rivals", "")
    assert one.go(0.2).speed > 0.0


def test_a_path_that_cannot_be_stopped_in_time_is_refused_before_anything_moves():
    with pytest.raises(InputError, match=r"to be stopped in 0\.05 s"):
        Run(stop_time=0.05)


events = st.sampled_from(["silent", "nan", "stop", "forbid", "dead", "stalled", "far", "deactivate"])


@settings(max_examples=15)
@given(st.lists(st.tuples(st.floats(0.02, 1.5), events, st.floats(0.01, 1.0)), min_size=1, max_size=5))
def test_whatever_happens_whenever_the_arm_is_never_told_to_accelerate_more_than_allowed(course):
    one = Run()
    for before, event, lasting in course:
        one.go(before)
        if event == "silent":
            one.go(lasting, measured=False)
        elif event == "nan":
            one.go(lasting, off=(math.nan, 0.0))
        elif event == "stop":
            one.give(one.gate.stop(one.now))
            one.go(lasting)
            one.gate.reset()
        elif event == "forbid":
            one.gate.forbid("rivals", "others publish")
            one.go(lasting)
            one.gate.forbid("rivals", "")
        elif event == "dead":
            one.give(one.gate.neutral_command(one.now))
            one.go(lasting, alive=False)
            one.gate.handed_over()
        elif event == "stalled":
            one.go(lasting, alive=False, measured=False)
        elif event == "far":
            one.go(lasting, velocity=(9.0, 0.0))
            one.go(TICK / SECOND)
            one.gate.reset()
        else:
            one.give(one.gate.deactivate(one.now))
            one.go(lasting)
            one.gate.activate()
    one.finish(10.0)
    assert one.within_acceleration()
    assert one.on_path() < 1e-5
    assert one.speed == 0.0
