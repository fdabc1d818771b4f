"""The bridge between a robot's topics and ours, one node in one process."""

from __future__ import annotations

import itertools
import math
import threading
import time

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.errors import InputError
from idloop_nodes import qos
from idloop_nodes.codec import (
    JointSample,
    decode_diagnostics,
    decode_joint_state,
    encode_joint_state,
)

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_environment")]
MS = 1_000_000
ROBOT, COMMANDS = "/robot/joint_states", "/robot/commands"
# Nothing here depends on how fast this machine is: silence is tested where the tests tell the time.
PATIENT = {"require_guardian": False, "watchdog": 10.0, "soft_start": 0.0, "limit.command": 2.0}
WHERE = {"robot_states": ROBOT, "robot_commands": COMMANDS, "robot_joints": "['elbow']", "joints": "['motor']"}


def numbers(data):
    """Of a Float64MultiArray without dimensions."""
    return tuple(np.frombuffer(data, offset=20))


class BridgeBench:
    def __init__(self, bench, **parameters):
        from sensor_msgs.msg import JointState
        from std_msgs.msg import Float64MultiArray

        self.bench = bench("bridge", **(PATIENT | WHERE | parameters))
        self.received = []
        other = self.bench.other
        self.robot = other.create_publisher(JointState, ROBOT, qos.stream())
        other.create_subscription(Float64MultiArray, COMMANDS, self.received.append, qos.stream(), raw=True)
        self.commander = self.bench.talk("joint_command")
        for topic in ("joint_states", "bridge/command", "/diagnostics"):
            self.bench.listen(topic)
        self.bench.matched(self.robot, self.commander)
        self.bench.until(self.bench.node._to_robot.get_subscription_count)
        self.bench.until(self.bench.node.publishers_by_topic["bridge/command"].get_subscription_count)
        self.stamp = time.time_ns()

    @property
    def gate(self):
        return self.bench.node._gate

    def measure(self, position=0.0, velocity=0.0):
        self.stamp += MS
        before = self.bench.node.counters.measured.count
        names, zeros = ("wrist", "elbow"), (0.0, velocity)
        self.robot.publish(encode_joint_state(JointSample(self.stamp, names, (0.0, position), zeros)))
        self.bench.until(lambda: self.bench.node.counters.measured.count > before)

    def command(self, value):
        """The robot's newest command after one of ours has been answered."""
        self.measure()
        return self.say(value)

    def say(self, value):
        self.stamp += MS
        before = self.bench.node.counters.commanded.count
        self.commander.publish(encode_joint_state(JointSample(self.stamp, ("motor",), effort=(value,))))
        self.bench.until(lambda: self.bench.node.counters.commanded.count > before)
        passed = self.gate._output
        self.until_told(passed)
        return passed

    def until_told(self, value):
        """Wait until this is the newest that the robot was told."""
        self.bench.until(lambda: self.received and numbers(self.received[-1])[-1] == value)


def test_a_measurement_is_passed_on_under_our_name_with_the_robots_stamp(bench):
    one = BridgeBench(bench)
    one.measure(position=0.25, velocity=-1.0)
    one.bench.until(lambda: one.bench.got["joint_states"])
    sample = decode_joint_state(one.bench.got["joint_states"][-1])
    assert (sample.stamp_ns, sample.names) == (one.stamp, ("motor",))
    assert (sample.position, sample.velocity) == ((0.25,), (-1.0,))
    assert math.isnan(sample.effort[0])


def test_a_measurement_without_a_stamp_gets_one(bench):
    one = BridgeBench(bench)
    one.robot.publish(encode_joint_state(JointSample(0, ("elbow",), (0.5,), (0.0,))))
    one.bench.until(lambda: one.bench.got["joint_states"])
    assert decode_joint_state(one.bench.got["joint_states"][-1]).stamp_ns > 10**18


def test_a_command_passes_within_its_limit(bench):
    one = BridgeBench(bench, controller_joints="['wrist', 'elbow']")
    assert one.command(1.5) == 1.5
    assert numbers(one.received[-1]) == (0.0, 1.5)
    assert one.command(-7.0) == -2.0


def test_what_is_not_a_number_is_zero_and_the_next_command_passes(bench):
    one = BridgeBench(bench)
    assert one.command(1.5) == 1.5
    assert one.command(math.nan) == 0.0
    assert one.command(1.5) == 1.5
    one.measure(position=math.nan)
    one.until_told(0.0)
    assert one.command(1.5) == 1.5


def test_a_breach_stays_until_reset_and_no_reset_helps_while_it_holds(bench):
    one = BridgeBench(bench, **{"limit.position_max": 1.0})
    assert one.command(1.5) == 1.5
    one.measure(position=1.2)
    one.until_told(0.0)
    answer = one.bench.call("/bridge/reset")
    assert not answer.success
    assert answer.message == "position 1.2 is above limit.position_max 1"
    assert one.command(1.5) == 0.0
    assert one.bench.call("/bridge/reset").success
    assert one.command(1.5) == 1.5


def test_the_emergency_stop_is_latched(bench):
    one = BridgeBench(bench)
    assert one.command(1.5) == 1.5
    assert one.bench.call("/bridge/emergency_stop").success
    one.until_told(0.0)
    assert one.command(1.5) == 0.0
    one.bench.node.trigger_deactivate()
    one.bench.node.trigger_activate()
    assert one.command(1.5) == 0.0
    assert one.bench.call("/bridge/reset").success
    assert one.command(1.5) == 1.5


@pytest.mark.parametrize("transition", ["deactivate", "shutdown"])
def test_the_motor_is_told_zero_when_the_node_leaves_the_active_state(bench, transition):
    one = BridgeBench(bench)
    assert one.command(1.5) == 1.5
    getattr(one.bench.node, f"trigger_{transition}")()
    one.until_told(0.0)
    assert not one.gate.active


def test_the_motor_is_told_zero_at_the_end(bench):
    one = BridgeBench(bench)
    assert one.command(1.5) == 1.5
    one.bench.node.close()
    one.until_told(0.0)


def test_no_parameter_can_be_changed_while_it_runs(bench):
    one = BridgeBench(bench)
    for name in ("limit.command", "soft_start", "watchdog"):
        assert not one.bench.set(name, 9.0).successful, name


def test_somebody_else_at_the_robots_topic_stops_the_motor_and_is_named(bench):
    from std_msgs.msg import Float64MultiArray

    one = BridgeBench(bench)
    assert one.command(1.5) == 1.5
    rival = one.bench.other.create_publisher(Float64MultiArray, COMMANDS, qos.stream(1))
    one.bench.until(lambda: "others publish on /robot/commands, past all limits: /bench" in one.gate.reason)
    assert one.command(1.5) == 0.0
    one.bench.until(lambda: "past all limits: /bench" in statuses(one).get("bridge: safety", ""))
    one.bench.other.destroy_publisher(rival)
    one.bench.until(lambda: not one.gate.forbidden)
    assert one.command(1.5) == 1.5


def test_a_second_commander_stops_the_motor_until_it_has_gone(bench):
    one = BridgeBench(bench)
    assert one.command(1.5) == 1.5
    second = one.bench.talk("joint_command")
    one.bench.until(lambda: "2 nodes publish joint_command" in one.gate.reason)
    assert one.command(1.5) == 0.0
    assert "end all but one, or set allow_other_commanders" in one.gate.reason
    one.bench.other.destroy_publisher(second)
    one.bench.until(lambda: not one.gate.forbidden)
    assert one.command(1.5) == 1.5


@pytest.mark.slow
def test_a_second_commander_that_is_allowed_is_said(bench):
    one = BridgeBench(bench, allow_other_commanders=True)
    second = one.bench.talk("joint_command")
    one.bench.matched(second)
    one.bench.until(lambda: "2 nodes publish joint_command" in statuses(one).get("bridge: streams", ""))
    assert one.command(1.5) == 1.5


def failing(*arguments):
    raise MemoryError


def test_a_thread_that_fails_sends_zero_at_once(bench, monkeypatch):
    one = BridgeBench(bench)
    assert one.command(1.5) == 1.5
    monkeypatch.setattr(one.gate, "tick", failing)
    one.until_told(0.0)
    assert isinstance(one.bench.node.broken, MemoryError)


def test_a_callback_that_fails_ends_the_node_with_a_zero(bench, monkeypatch):
    one = BridgeBench(bench)
    assert one.command(1.5) == 1.5
    monkeypatch.setattr(one.gate, "command", failing)
    with pytest.raises(MemoryError):
        one.say(1.5)
    one.bench.node.close()  # as the end of every process does
    monkeypatch.undo()
    one.until_told(0.0)


def test_the_last_word_needs_no_lock(bench):
    """Whoever hangs may hold it."""
    one = BridgeBench(bench)
    assert one.command(1.5) == 1.5
    with one.bench.node._lock:
        one.bench.node._send_neutral()
        assert one.gate._output == 0.0


class TimedLock:
    """A lock that knows since when it has been held."""

    def __init__(self):
        self.lock, self.held_since = threading.Lock(), 0

    def acquire(self, **patience):
        got = self.lock.acquire(**patience)
        self.held_since = time.monotonic_ns()
        return got

    def release(self):
        self.lock.release()

    def __enter__(self):
        return self.acquire()

    def __exit__(self, *error):
        self.release()


def test_time_never_runs_backwards_between_the_threads_of_the_gate(bench, monkeypatch):
    """Two threads ask the gate: who waited for the other must not come with the time before the wait."""
    one = BridgeBench(bench)
    lock, early = TimedLock(), {"command": [], "measure": [], "tick": []}
    monkeypatch.setattr(one.bench.node, "_lock", lock)
    for name, seen in early.items():
        asked = getattr(one.gate, name)

        def timed(now_ns, *values, asked=asked, seen=seen):
            seen.append(now_ns < lock.held_since)
            return asked(now_ns, *values)

        monkeypatch.setattr(one.gate, name, timed)
    assert one.command(1.5) == 1.5
    one.bench.until(lambda: all(early.values()))
    assert not any(itertools.chain(*early.values()))


def test_a_bridge_that_cannot_send_shows_the_guardian_no_beat(bench, monkeypatch):
    one = BridgeBench(bench, require_guardian=True)
    beats = []
    monkeypatch.setattr(one.bench.node._guardian, "beat", beats.append)
    one.measure()
    one.bench.until(lambda: len(beats) > 3)
    assert numbers(beats[-1]) == (0.0,), "what the guardian is to send"
    monkeypatch.setattr(one.bench.node, "_to_robot", None)  # the middleware is lost
    one.bench.until(lambda: one.bench.node.broken is not None)
    before = len(beats)
    one.bench.executor.spin_once(timeout_sec=0.05)
    assert len(beats) == before
    monkeypatch.undo()


def test_faster_measurements_than_asked_for_are_left_out(bench):
    one = BridgeBench(bench, measurement_rate=250.0)
    for _ in range(20 + 80):
        one.measure()  # 1 ms apart
    one.bench.until(lambda: len(one.bench.got["joint_states"]) + one.bench.node._decimator.left_out == 100)
    assert 43 <= len(one.bench.got["joint_states"]) <= 46, "a burst, and then every fourth"


def test_health_names_a_joint_that_is_not_there(bench):
    one = BridgeBench(bench)
    one.robot.publish(encode_joint_state(JointSample(one.stamp, ("wrist", "gripper"), (0.0, 0.0))))
    text = "no joint elbow in /robot/joint_states: wrist, gripper"
    one.bench.until(lambda: text in statuses(one).values())


def statuses(one):
    """Newest words of each check."""
    return {
        status.name: status.message for data in one.bench.got["/diagnostics"] for status in decode_diagnostics(data)[1]
    }


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"robot_states": "/joint_states"}, "robot_states is /joint_states, which is our own joint_states"),
        ({"robot_commands": "joint_command"}, "robot_commands is /joint_command, which is our own joint_command"),
        ({"limit.command": "0.0", "fields": "[velocty]"}, "did you mean 'velocity'"),
    ],
)
def test_what_cannot_work_is_one_line(bench, parameters, said):
    with pytest.raises(InputError, match=said) as caught:
        bench("bridge", **(PATIENT | WHERE | parameters))
    assert "\n" not in str(caught.value)


def test_without_a_limit_it_does_not_start(bench):
    with pytest.raises(InputError, match=r"limit\.command is not set"):
        bench("bridge", **WHERE)
