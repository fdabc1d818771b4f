"""The trajectory bridge: the last node before the joint_trajectory_controller of an arm."""

from __future__ import annotations

import time

from sensor_msgs.msg import JointState

from idloop.errors import InputError
from idloop.records.bags.cdr import SECOND
from idloop.robots.joint_limits import urdf_limits
from idloop.robots.joint_path import read_path
from idloop_nodes import qos
from idloop_nodes.codec import CdrError, JointReader, JointWriter, Status, TrajectoryPoint, encode_trajectory
from idloop_nodes.codec.joints import FIELDS
from idloop_nodes.safety.guarded_node import GuardedNode
from idloop_nodes.safety.last_node import TRAJECTORY, prepare
from idloop_nodes.safety.trajectory_gate import Piece, TrajectoryGate, TrajectorySettings

__all__ = ["TrajectoryBridgeNode", "make", "prepare"]


class TrajectoryBridgeNode(GuardedNode[Piece]):
    """Sends a planned trajectory piece by piece through a `TrajectoryGate`, while the robot's measurements are well."""

    _gate: TrajectoryGate

    def __init__(self) -> None:
        super().__init__("trajectory_bridge")
        values = self.parameters
        for name in ("trajectory", "urdf", "limit.acceleration"):
            if not values[name]:
                raise InputError(f"trajectory_bridge: {name} is not set; give {name}:=...")
        path = read_path(values["trajectory"])
        self._joints = path.joints
        settings = TrajectorySettings(
            urdf_limits(values["urdf"], path.joints, values["limit.acceleration"]),
            following_error=values["limit.following_error"],
            approach=values["approach"],
            stop_time=values["stop_time"],
            horizon=values["horizon"],
            watchdog=values["watchdog"],
            latch_watchdog=values["latch_watchdog"],
        )
        try:
            self._gate = TrajectoryGate(path, settings)
        except InputError as error:
            raise InputError(f"{values['trajectory']}: {error}") from error
        self._reader = JointReader([(joint, field) for field in FIELDS for joint in path.joints])
        self._sent_writer = JointWriter(path.joints, ("position", "velocity"))
        # Only the newest counts: after a pause the arm is not where those that have waited say.
        newest = qos.stream(1, reliable=values["reliable"])
        self.subscribe(JointState, values["robot_states"], self._on_measurement, newest)
        self.get_logger().info(
            f"{path.duration:g} s for {len(path.joints)} joints; a stop takes {values['stop_time']:g} s, and after the "
            f"loss of this machine {values['horizon'] + values['stop_time']:g} s"
        )
        self.guard(self._gate, TRAJECTORY)

    def _on_measurement(self, data: bytes) -> None:
        wall = time.time_ns()
        try:
            stamp, row = self._reader.read(data)
        except CdrError:
            self.counters.unreadable += 1
            return
        if not set(self._joints) & set(self._reader.names):
            return  # of another part of the robot
        count = len(self._joints)
        with self._lock:
            self._robot_clock.update(stamp, wall)
            self._send(
                self._gate.measure(time.monotonic_ns(), stamp, row[:count], row[count : 2 * count], row[2 * count :])
            )
            self.counters.measured.count += 1

    def message(self, stamp: int, command: Piece) -> bytes:
        """Return a piece as trajectory_msgs/JointTrajectory, stamped in the robot's clock."""
        rows = zip(command.time, command.position, command.velocity, strict=True)
        points = [
            TrajectoryPoint(round(float(since) * SECOND), tuple(position), tuple(velocity))
            for since, position, velocity in rows
        ]
        return encode_trajectory(self._robot_clock.stamp(stamp), self._joints, points)

    def applied(self, stamp: int, command: Piece) -> bytes:
        """Return where the arm is told to be as JointState."""
        return self._sent_writer.pack(stamp, tuple(command.position[0]), tuple(command.velocity[0]))

    def poll(self) -> None:
        """End when the trajectory has come to its end."""
        super().poll()
        if self._gate.share_done >= 1.0 and not self.finished and self.parameters["end_when_done"]:
            self.get_logger().info("the trajectory has come to its end")
            self.finished = True

    def health(self) -> list[Status]:
        """Return the stream, and what the safety gate has done."""
        gate = self._gate
        streams = {
            "clock_behind": f"{self._robot_clock.behind / 1e9:.6f}",
            "clock_jumps": str(gate.measurements.jumps),
            "stale": str(gate.measurements.stale),
            "real_time_priority": str(self._urgent).lower(),
        }
        missing = [joint for joint in self._joints if joint not in self._reader.names]
        topic = self.parameters["robot_states"]
        problem = (
            f"no joint {missing[0]} in {topic}: {', '.join(self._reader.names)}"
            if self._reader.names and missing
            else ""
        )
        return [self.counters.status(streams, 0, problem), self.safety({"done": f"{gate.share_done:.3f}"})]


make = TrajectoryBridgeNode
