"""A publisher that does not satisfy a subscription is named with the cure, until it is mended."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from idloop_nodes.codec import Level, decode_diagnostics
from idloop_nodes.qos import stream
from idloop_nodes.streams.stream_match import QualityWatch, mismatch

pytestmark = [pytest.mark.ros]
BEST_EFFORT, RELIABLE = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE
VOLATILE, LATCHED = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL


def profile(reliability, durability=VOLATILE):
    return QoSProfile(depth=10, reliability=reliability, durability=durability)


@pytest.mark.parametrize(
    ("offered", "wanted", "cure"),
    [
        ((RELIABLE, VOLATILE), (RELIABLE, VOLATILE), None),
        ((RELIABLE, LATCHED), (RELIABLE, VOLATILE), None),
        ((RELIABLE, VOLATILE), (BEST_EFFORT, VOLATILE), None),
        ((BEST_EFFORT, VOLATILE), (BEST_EFFORT, VOLATILE), None),
        ((BEST_EFFORT, VOLATILE), (RELIABLE, VOLATILE), "reliable"),
        ((RELIABLE, VOLATILE), (RELIABLE, LATCHED), "transient local"),
    ],
)
def test_what_satisfies_what(offered, wanted, cure):
    found = mismatch(profile(*offered), profile(*wanted))
    assert (found and found[1]) == cure


class Graph:
    """A node of which only the graph is asked."""

    def __init__(self):
        self.publishers = []

    def get_publishers_info_by_topic(self, topic):
        return self.publishers


class Publisher:
    def __init__(self, name, qos_profile):
        self.node_name, self.node_namespace, self.qos_profile = name, "/robot", qos_profile


class Subscription:
    topic_name = "/joint_states"
    qos_profile = stream()


def test_it_is_said_once_and_taken_back():
    graph, lines = Graph(), []
    watch = QualityWatch(graph, lines.append)
    watch.watch("joint_states", Subscription, "start recorder with `reliable: false`")
    watch.check()
    assert (lines, watch.status()) == ([], [])
    graph.publishers = [Publisher("driver", profile(BEST_EFFORT))]
    watch.check()
    watch.check()
    (line,) = lines
    assert line == (
        "/joint_states: nothing arrives from /robot/driver, it publishes best effort and reliable is asked for: start"
        " recorder with `reliable: false`, or publish it reliable"
    )
    (status,) = watch.status()
    assert (status.level, status.message) == (Level.WARN, lines[0])
    graph.publishers = [Publisher("driver", profile(RELIABLE))]
    watch.check()
    (status,) = watch.status()
    assert (len(lines), status.level) == (1, Level.OK)
    graph.publishers = [Publisher("driver", profile(BEST_EFFORT))]
    watch.check()
    assert len(lines) == 2


def test_what_the_middleware_reports_is_said_before_the_graph_knows_the_publisher():
    graph, lines = Graph(), []
    watch = QualityWatch(graph, lines.append)
    watch.watch("joint_states", Subscription)

    class Event:
        from rclpy.qos import QoSPolicyKind

        last_policy_kind = QoSPolicyKind.RELIABILITY

    watch.callbacks("joint_states").incompatible_qos(Event)
    assert len(lines) == 1
    assert "/joint_states" in lines[0]
    assert "reliability" in lines[0]
    graph.publishers = [Publisher("driver", profile(RELIABLE))]
    watch.check()
    assert watch.status()[0].level == Level.OK


def publisher_of(bench, topic, reliability, kind=JointState):
    quiet = PublisherEventCallbacks(use_default_callbacks=False)
    return bench.other.create_publisher(kind, topic, profile(reliability), event_callbacks=quiet)


CASES = [
    ("recorder", {"topics": "[joint_states]"}, "joint_states"),
    ("estimator", {"model": "dc_motor"}, "joint_states"),
    (
        "bridge",
        {"robot_states": "/robot/states", "limit.command": "1.0", "require_guardian": "false"},
        "/robot/states",
    ),
]


def started(bench, kind, parameters, tmp_path, **more):
    extra = {"bag": str(tmp_path / "bag")} if kind == "recorder" else {}
    return bench(kind, **parameters, **extra, **more)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "parameters", "topic"), CASES, ids=[kind for kind, *_ in CASES])
def test_a_best_effort_publisher_is_named_on_diagnostics_until_it_is_gone(bench, tmp_path, kind, parameters, topic):
    one = started(bench, kind, parameters, tmp_path)
    one.listen("/diagnostics")
    publisher = publisher_of(one, topic, BEST_EFFORT)

    def newest():
        found = [
            status
            for data in one.got["/diagnostics"]
            for status in decode_diagnostics(data)[1]
            if status.name.endswith(": quality of service")
        ]
        return found[-1] if found else None

    one.until(lambda: newest() is not None)
    warned = newest()
    assert warned.level == Level.WARN
    for word in (
        topic.lstrip("/"),
        "/bench",
        "best effort",
        "reliable is asked for",
        f"start {kind}",
        "reliable: false",
    ):
        assert word in warned.message
    one.other.destroy_publisher(publisher)
    publisher_of(one, topic, RELIABLE)
    one.until(lambda: newest().level == Level.OK)


@pytest.mark.parametrize(("kind", "parameters", "topic"), CASES, ids=[kind for kind, *_ in CASES])
def test_the_cure_helps(bench, tmp_path, kind, parameters, topic):
    one = started(bench, kind, parameters, tmp_path, reliable="false")
    publisher = publisher_of(one, topic, BEST_EFFORT)
    one.matched(publisher)
    one.node.quality.check()
    assert one.node.quality.status() == []


def test_a_result_that_is_not_kept_for_late_joiners_is_named(bench, tmp_path):
    one = bench("recorder", topics="[estimator/fit]", bag=str(tmp_path / "bag"))
    publisher_of(one, "estimator/fit", RELIABLE, DiagnosticArray)
    one.until(one.node.quality.status)
    (status,) = one.node.quality.status()
    assert "volatile and transient local is asked for: publish it transient local" in status.message
