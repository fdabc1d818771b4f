"""The end of a run is announced only when whoever listens has everything that was published."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop_nodes.codec import JointSample, encode_joint_state
from idloop_nodes.progress import DONE

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_environment")]

LISTENER = """
import rclpy
from idloop_nodes.qos import topic_qos, topic_type

rclpy.init()
node = rclpy.create_node("listener")
heard = []
node.create_subscription(topic_type("estimator/prediction"), "estimator/prediction", heard.append,
                         topic_qos("estimator/prediction"), raw=True)
while True:
    rclpy.spin_once(node)
    print(len(heard), flush=True)
"""


def test_a_listener_without_processor_time_is_waited_for(bench):
    one = bench("estimator", model="dc_motor", sample_time=0.01, mode="realtime", auto_diagnose=False)
    node, heard = one.node, []
    one.other.create_subscription(node._progress_publisher.msg_type, "progress", heard.append, 10)
    publisher = node.publishers_by_topic["estimator/prediction"]
    telling = threading.Thread(target=node.tell_progress, args=(101, DONE))
    with subprocess.Popen([sys.executable, "-c", LISTENER], stdout=subprocess.PIPE, text=True) as child:
        try:
            one.until(publisher.get_subscription_count)
            publisher.publish(encode_joint_state(JointSample(1, ("motor",), (0.0,), (0.0,))))
            assert child.stdout.readline().strip() == "1"
            child.send_signal(signal.SIGSTOP)
            for stamp in range(2, 102):
                publisher.publish(encode_joint_state(JointSample(stamp, ("motor",), (0.0,), (0.0,))))
            telling.start()
            stood_since = time.monotonic()
            one.until(lambda: time.monotonic() - stood_since > 0.5)
            assert telling.is_alive(), "the end was told to a graph in which nobody has the data yet"
            assert not told(heard)
            child.send_signal(signal.SIGCONT)
            one.until(lambda: told(heard))
            assert int(next(line for line in child.stdout if int(line) == 101)) == 101
        finally:
            child.kill()
            if telling.ident is not None:
                telling.join()


def told(heard):
    """Whether the end has been told."""
    return any(message.frame_id.endswith(DONE) for message in heard)
