"""ROS for tests: its packages imported once, without the warnings of their own imports; a bench for one node."""

from __future__ import annotations

import contextlib
import importlib
import sys
import time
import warnings
from pathlib import Path

import pytest

# The files of a benchmark are scripts beside each other: they are found where they lie.
BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
sys.path += [str(BENCHMARKS), str(BENCHMARKS / "graph_faults")]

with warnings.catch_warnings(), contextlib.suppress(ImportError):
    warnings.simplefilter("ignore")
    import rclpy.serialization
    from diagnostic_msgs.msg import DiagnosticArray
    from sensor_msgs.msg import JointState

    for message in (DiagnosticArray, JointState):
        rclpy.serialization.serialize_message(message())  # loads the type support

WAIT = 200.0  # ends what hangs; a busy machine takes its time


class Bench:
    """One node under test and one that talks to it, turned by hand."""

    def __init__(self, kind, **parameters):
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        arguments = ["test", "--ros-args"]
        for name, value in parameters.items():
            arguments += ["-p", f"{name}:={value}"]
        rclpy.init(args=arguments)
        self.executor = SingleThreadedExecutor()
        self.node = importlib.import_module(f"idloop_nodes.nodes.{kind}").make()
        self.other = rclpy.create_node("bench")
        self.got = {}
        self.executor.add_node(self.node)
        self.executor.add_node(self.other)

    def listen(self, topic):
        from idloop_nodes.qos import topic_qos, topic_type

        self.got[topic] = []
        self.other.create_subscription(topic_type(topic), topic, self.got[topic].append, topic_qos(topic), raw=True)

    def talk(self, topic):
        from idloop_nodes.qos import topic_qos, topic_type

        return self.other.create_publisher(topic_type(topic), topic, topic_qos(topic))

    def until(self, condition, wait=WAIT):
        end = time.monotonic() + wait
        while not condition():
            assert time.monotonic() < end, "condition not met in time"
            self.executor.spin_once(timeout_sec=0.01)
            self.node.poll()

    def matched(self, *publishers):
        self.until(lambda: all(one.get_subscription_count() for one in publishers))

    def call(self, service):
        from std_srvs.srv import Trigger

        client = self.other.create_client(Trigger, service)
        self.until(client.service_is_ready)
        future = client.call_async(Trigger.Request())
        self.until(future.done)
        return future.result()

    def set(self, name, value):
        from rclpy.parameter import Parameter

        (result,) = self.node.set_parameters([Parameter(name, value=value)])
        return result

    def close(self):
        import rclpy

        self.node.close()
        self.executor.shutdown()
        self.node.destroy_node()
        self.other.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def bench():
    """Build a bench around a node of a kind, with parameters."""
    rclpy = pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")
    benches = []

    def build(kind, **parameters):
        benches.append(Bench(kind, **parameters))
        return benches[-1]

    yield build
    for one in benches:
        one.close()
    rclpy.try_shutdown()
