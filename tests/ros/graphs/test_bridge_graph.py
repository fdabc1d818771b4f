"""A robot driven through the bridge while its peers die, hang and lie: judged by what the robot was told.

How soon zero comes is measured by ``benchmarks/bridge_faults.py``, and kept in simulated time by test_bridge_safety.
"""

from __future__ import annotations

import signal
import time
from contextlib import contextmanager
from functools import partial
from itertools import takewhile

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

import rclpy
from robot_graph import PATIENCE, RobotGraph

from idloop.ending_signals import ending_signals
from idloop_nodes.codec import JointSample, encode_joint_state
from idloop_nodes.middleware import LEASE
from idloop_nodes.qos import stream

pytestmark = [pytest.mark.ros, pytest.mark.whole_graph]


@pytest.fixture
def bridge_parameters():
    """Parameters of the bridge beside those that all tests have."""
    return {}


class Shared:
    """One graph for all tests that leave it driving, as they found it; a new one after a test that has failed."""

    def __init__(self, folders):
        self.folders, self.graph, self.failed = folders, None, 0

    def lend(self, failed):
        if failed != self.failed:
            self.end()
        if self.graph is None:
            self.graph, self.failed = RobotGraph(self.folders.mktemp("graph"), {}), failed
        return self.graph

    def end(self):
        if self.graph is not None:
            self.graph.stop()
            self.graph = None


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    one = Shared(tmp_path_factory)
    yield one
    one.end()


@pytest.fixture
def own_graph(shared, tmp_path, ros_environment, bridge_parameters):
    """A graph for a test that ends a node of it, sets its clock or wants a bridge of its own."""
    shared.end()  # one robot in a domain
    one = RobotGraph(tmp_path, bridge_parameters)
    try:
        yield one
    finally:
        one.stop()


@pytest.fixture
def graph(shared, ros_environment, request):
    """The shared graph, driving."""
    return shared.lend(request.session.testsfailed)


@contextmanager
def stranger(topic):
    """A node that publishes where it should not."""
    from sensor_msgs.msg import JointState

    rclpy.init()
    node = rclpy.create_node("stranger")
    try:
        yield node.create_publisher(JointState, topic, stream(10))
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def call(service):
    """Call a Trigger service as anybody on the network can."""
    from std_srvs.srv import Trigger

    rclpy.init()
    node = rclpy.create_node("caller")
    try:
        client = node.create_client(Trigger, service)
        assert client.wait_for_service(timeout_sec=PATIENCE)
        future = client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(node, future, timeout_sec=PATIENCE)
        return future.result()
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


@pytest.mark.slow
@pytest.mark.parametrize("bridge_parameters", [{"soft_start": 1.0}])
def test_the_start_is_soft(own_graph):
    own_graph.until_driven()
    commands = [command for _, command, _ in own_graph.told()]
    rise = list(takewhile(bool, reversed(commands[: commands.index(1.5)])))[::-1]
    assert rise == sorted(rise)
    assert len(rise) > 3, "a second, at one command in 5 ms"


@pytest.mark.slow
def test_a_killed_controller_is_zero(own_graph):
    own_graph.until_driven()
    own_graph.until_zero_after(own_graph.signal("controller", signal.SIGKILL))


@pytest.mark.slow
def test_a_clock_that_is_set_forth_and_back_is_told_zero(own_graph):
    own_graph.until_driven()
    own_graph.until_zero_after(own_graph.order("jump", 3600))
    # The excitation lives in the present: an hour ahead there is none to pass on.
    own_graph.order("jump", -3600)
    own_graph.until_driven()
    # What was measured then is taken for the beginning of a new run, and that is soft.
    own_graph.until_zero_after(own_graph.order("jump", -3600), count=1)
    own_graph.until_driven()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["controller", "excitation"])
def test_a_stopped_peer_is_zero_and_goes_on_when_it_does(graph, name):
    graph.until_driven()
    graph.until_zero_after(graph.signal(name, signal.SIGSTOP))
    graph.signal(name, signal.SIGCONT)
    graph.until_driven()


def test_a_robot_that_does_not_measure_is_told_zero(graph):
    graph.until_driven()
    graph.until_zero_after(graph.order("quiet"))
    graph.order("good")
    graph.until_driven()


def test_a_robot_that_measures_nonsense_is_told_zero(graph):
    graph.until_driven()
    graph.until_zero_after(graph.order("nan"))
    graph.order("good")
    assert call("/controller/reset").success
    graph.until_driven()


def test_a_stranger_that_commands_is_zero_until_it_has_gone(graph):
    graph.until_driven()
    with stranger("/joint_command") as publisher:
        graph.until(publisher.get_subscription_count)
        began = time.monotonic_ns()
        graph.until(lambda: publish(publisher, 2.0) and len(graph.told(began)) > 400)
        graph.until_zero_after(began)
        assert 2.0 not in {command for _, command, _ in graph.told()}
        assert "2 nodes publish joint_command (/controller, /stranger)" in graph.said("bridge")
    graph.until_driven()


@pytest.mark.slow
@pytest.mark.parametrize("bridge_parameters", [{"allow_other_commanders": True}])
def test_a_stranger_that_is_allowed_moves_nothing_past_the_limits(own_graph):
    def told(since):
        return [command for _, command, _ in own_graph.told(since)]

    for value, passed in ((float("nan"), 0.0), (-1e300, -2.0)):
        since = own_graph.until_driven()
        with stranger("/joint_command") as publisher:
            own_graph.until(publisher.get_subscription_count)
            seen = partial(commanding, publisher, value, passed, partial(told, since))
            own_graph.until(seen)
        assert all(abs(command) <= 2.0 for command in told(since))
    own_graph.until_driven()


def commanding(publisher, value, passed, told):
    """Command once more; whether the robot has been told what comes of it, for long enough."""
    publish(publisher, value)
    return passed in told() and len(told()) > 400


def publish(publisher, value):
    publisher.publish(encode_joint_state(JointSample(time.time_ns(), ("motor",), effort=(value,))))
    return True


@pytest.mark.slow
def test_the_emergency_stop_holds_whatever_the_controller_says(graph):
    since = graph.until_driven()
    assert call("/bridge/emergency_stop").success
    graph.until_zero_after(since)
    stopped = time.monotonic_ns()
    graph.until(lambda: len(graph.told(stopped)) > 200)
    assert graph.still(stopped)
    assert call("/bridge/reset").success
    graph.until_driven()


@pytest.mark.slow
@pytest.mark.parametrize("bridge_parameters", [{"require_guardian": False}])
def test_the_last_word_of_a_bridge_is_zero_whatever_signal_ends_it(own_graph):
    """Without the guardian, which would say it as well."""
    own_graph.signal("guardian", signal.SIGKILL)
    own_graph.processes["guardian"].wait()
    numbers = [*(one for one in ending_signals() if one <= signal.SIGRTMIN), signal.SIGTSTP]  # one of those beyond
    assert {signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGABRT} < set(numbers)
    for number in numbers:
        own_graph.until_driven()
        own_graph.signal("bridge", number)
        assert own_graph.processes["bridge"].wait(timeout=PATIENCE) == 0, number
        own_graph.until(lambda: own_graph.newest()[1] == 0.0)
        own_graph.start("bridge")


def test_bridge_and_guardian_stop_the_motor_when_the_other_is_killed_or_hangs(own_graph):
    own_graph.until_driven()
    own_graph.until_zero_after(own_graph.signal("bridge", signal.SIGSTOP))
    own_graph.signal("bridge", signal.SIGCONT)
    own_graph.until_driven()
    own_graph.until_zero_after(own_graph.signal("bridge", signal.SIGKILL))
    own_graph.processes["bridge"].wait()
    own_graph.start("bridge")
    own_graph.until_driven()
    assert own_graph.said("guardian").count("/bridge is silent or gone: the guardian stops the motor") == 2
    # and the other way round
    own_graph.until_zero_after(own_graph.signal("guardian", signal.SIGSTOP))
    own_graph.signal("guardian", signal.SIGCONT)
    own_graph.until_driven()
    own_graph.until_zero_after(own_graph.signal("guardian", signal.SIGKILL))
    own_graph.processes["guardian"].wait()
    said = own_graph.said("bridge")
    assert "the motor is stopped: the guardian is silent" in said
    assert "the motor is stopped: the guardian is gone" in said
    own_graph.start("guardian")
    own_graph.until_driven()


@pytest.mark.slow
def test_a_node_that_stood_still_until_it_was_forgotten_is_met_again(own_graph):
    name = "controller"
    own_graph.until_driven()
    stopped = own_graph.signal(name, signal.SIGSTOP)
    own_graph.until_zero_after(stopped)
    own_graph.until(lambda: time.monotonic_ns() - stopped > (LEASE + 2.0) * 1e9)
    own_graph.signal(name, signal.SIGCONT)
    own_graph.until_driven()
    assert "stood still for so long that the other nodes have forgotten it: starts anew" in own_graph.said(name)


@pytest.mark.parametrize(
    "bridge_parameters",
    # A command that is late on a busy machine would stop the motor before the limit does.
    [{"limit.position_max": 20.0, "limit.position_min": -20.0, "limit.coast_time": 0.5, "watchdog": 1.0}],
)
def test_nobody_drives_the_motor_past_its_position_limit(own_graph):
    """The preset coasts for inertia / friction = 0.5 s: it is stopped so early that it comes to rest inside."""
    driven = own_graph.until_driven()
    own_graph.until_zero_after(driven)
    assert "coasting to position" in own_graph.said("bridge")
    stopped = time.monotonic_ns()
    own_graph.until(lambda: len(own_graph.told(stopped)) > 400)
    assert own_graph.still(stopped), "the controller cannot push it on"
    assert max(position for _, _, position in own_graph.told()) > 19.0
    call("/bridge/reset")
    own_graph.until(lambda: len(own_graph.told(stopped)) > 1000)
    own_graph.until_zero_after(own_graph.told(stopped)[-1][0])
    own_graph.until(lambda: abs(own_graph.told()[-1][2] - own_graph.told()[-100][2]) < 1e-2)
