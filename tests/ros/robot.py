"""``python robot.py LOG PERIOD [--ros-args ...]``: a robot with three joints; tests start it as a process.

It publishes JointState on ``/robot/joint_states`` and takes Float64MultiArray on ``/robot/commands``, as a robot with
a controller of ros2_control does; a simulated motor moves the joint in the middle. Orders on stdin: ``quiet``,
``nan``, ``jump SECONDS``, ``pace FACTOR`` and ``good`` change what it measures, ``end`` ends it. It writes one line for
each order, each command and each measurement, with the time of its own steady clock, into LOG.
"""

from __future__ import annotations

import math
import sys
import threading
import time
from pathlib import Path

import rclpy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from idloop.physics import Plant, load_model
from idloop_nodes import qos
from idloop_nodes.codec import JointSample, encode_joint_state
from idloop_nodes.middleware import use_sockets_only
from idloop_nodes.runtime import make_executor
from idloop_nodes.timing import become_urgent

NAMES = ("wrist", "elbow", "shoulder")


class Robot:
    """The motor of the preset as the joint in the middle, at its own pace."""

    def __init__(self, log, period):
        self.log, self.period = log, period
        self.mood, self.shift_ns, self.pace = "good", 0, 1.0
        self.commanded = 0.0
        self.ended = threading.Event()
        self.plant = Plant(load_model("dc_motor"), noise=False)
        self.plant.measure()  # compiles before the clock runs
        self.node = rclpy.create_node("robot")
        self.states = self.node.create_publisher(JointState, "/robot/joint_states", qos.stream(10))
        self.node.create_subscription(Float64MultiArray, "/robot/commands", self.take, qos.stream(10))

    def write(self, *words):
        self.log.write(" ".join(map(str, (time.monotonic_ns(), *words))) + "\n")
        self.log.flush()

    def take(self, message):
        values = message.data
        self.commanded = values[1]
        self.write("command", values[1], float(self.plant.position[0]))

    def obey(self):
        for line in sys.stdin:
            self.mood, *words = line.split()
            if self.mood == "pace":
                self.pace = float(words[0])
            elif words:
                self.shift_ns += int(float(words[0]) * 1e9)
            self.write("order", self.mood)
            if self.mood == "end":
                break
        self.ended.set()

    def run(self):
        threading.Thread(target=self.obey, daemon=True).start()
        executor = make_executor()
        executor.add_node(self.node)
        started, due = time.monotonic(), self.period
        while not self.ended.is_set():
            now = time.monotonic() - started
            if now < due:
                executor.spin_once(timeout_sec=due - now)
                continue
            due = max(due + self.period / self.pace, now)
            self.plant.step(self.commanded, now)
            if self.mood != "quiet":
                position, velocity = self.plant.measure()
                bad = math.nan if self.mood == "nan" else 0.0
                stamp = time.time_ns() + self.shift_ns
                sample = JointSample(stamp, NAMES, (0.0, position + bad, 0.0), (0.0, velocity, 0.0), (0.0, 0.0, 0.0))
                self.states.publish(encode_joint_state(sample))
                self.write("sent", stamp)


if __name__ == "__main__":
    # The bridge is what is measured: neither a busy machine nor a peer that is stopped holds this process up.
    become_urgent()
    use_sockets_only()
    rclpy.init()
    with Path(sys.argv[1]).open("w", encoding="utf-8") as log:
        Robot(log, float(sys.argv[2])).run()
    rclpy.try_shutdown()
