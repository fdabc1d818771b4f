"""The MuJoCo arm of the benchmarks, the bridge that lets it follow a trajectory, and its guardian, as processes."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np

from idloop.graph.command import node_environment

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
URDF = BENCHMARKS / "six_joint_arm" / "arm.urdf"
PATIENCE = 300.0  # a busy machine takes its time to start a node
ACCELERATION, STOP_TIME, HORIZON, WATCHDOG = 12.0, 0.5, 0.1, 0.1
PERIOD = 0.002  # of the measurements of the arm
KEPT = 4000  # newest of them
JOINTS = ("base_yaw", "shoulder", "elbow", "wrist_pitch", "wrist_roll", "tool")


def write_swing(path, amplitude=0.5, period=4.0, duration=40.0):
    """Write a trajectory that swings all joints from 0, out of step with each other."""
    from idloop.robots.excitation import Trajectory, trajectory_text

    at = np.arange(round(duration * 50) + 1) / 50
    wave = 2.0 * np.pi / period * np.array([1, 2, 1, 2, 1, 2])
    position = 0.5 * amplitude * (1.0 - np.cos(np.outer(at, wave)))
    velocity = 0.5 * amplitude * wave * np.sin(np.outer(at, wave))
    path.write_text(
        trajectory_text(Trajectory(JOINTS, at, position, velocity, 0.0 * position, 1.0, 1.0, 1.0, ()), "csv"),
        encoding="utf-8",
    )


class ArmGraph:
    """Arm, bridge and guardian; what the arm was told is in its log."""

    def __init__(self, folder, **bridge_parameters):
        self.folder, self.log = folder, folder / "arm.csv"
        self.environment = node_environment()
        write_swing(folder / "trajectory.csv")
        bridge = {
            "trajectory": folder / "trajectory.csv", "urdf": URDF, "limit.acceleration": ACCELERATION,
            "stop_time": STOP_TIME, "horizon": HORIZON, "watchdog": WATCHDOG,
        }  # fmt: skip
        self.parameters = {"trajectory_bridge": bridge | bridge_parameters, "guardian": {"bridge": "trajectory_bridge"}}
        self.processes = {}
        self.read_to, self.newest = 0, np.zeros((0, 26))
        self._popen("arm", [sys.executable, str(BENCHMARKS / "arm_robot.py"), "--log", str(self.log)])
        for name in self.parameters:
            self.start(name)

    def start(self, name):
        words = [word for key, value in self.parameters[name].items() for word in ("-p", f"{key}:={value}")]
        self._popen(name, [sys.executable, "-m", "idloop_nodes", name, "--ros-args", *words])

    def _popen(self, name, words):
        if name in self.processes:
            self.processes[name].wait()
        with (self.folder / f"{name}.txt").open("a", encoding="utf-8") as said:
            self.processes[name] = subprocess.Popen(words, env=self.environment, stdout=said, stderr=subprocess.STDOUT)

    def signal(self, name, number):
        """Send a signal to a process; return the steady time at which it had been sent."""
        self.processes[name].send_signal(number)
        return time.monotonic_ns()

    def rows(self):
        """What the arm has written of late: (n, 26), steady time, refused messages, told and measured motion."""
        if self.log.exists():
            with self.log.open(encoding="utf-8") as file:
                file.seek(self.read_to)
                whole, end, _ = file.read().rpartition("\n")
            self.read_to += len((whole + end).encode())
            new = np.array([line.split(",") for line in whole.splitlines()], dtype=float).reshape(-1, 26)
            self.newest = np.vstack([self.newest, new])[-KEPT:]
        return self.newest

    def until(self, condition):
        end = time.monotonic() + PATIENCE
        while not condition(self.rows()):
            assert time.monotonic() < end, {
                one: (self.folder / f"{one}.txt").read_text()[-300:] for one in self.processes
            }
            threading.Event().wait(0.05)

    def until_moving(self):
        """Wait until the arm moves at full pace; return the time."""
        since = time.monotonic_ns()
        self.until(lambda rows: len(rows) and rows[-1, 0] > since + 2e9 and np.max(np.abs(rows[-1, 8:14])) > 0.3)
        return time.monotonic_ns()

    def until_rest_after(self, since):
        """Seconds from an instant to the beginning of half a second of rest."""

        def found(rows):
            later = rows[rows[:, 0] > since]
            rest = np.max(np.abs(later[:, 8:14]), axis=1, initial=0.0) == 0.0
            begin = len(rest) - np.argmin(rest[::-1]) if not np.all(rest) else 0
            self.rested = later[begin, 0] if begin < len(later) else np.inf
            return len(later) and later[-1, 0] - self.rested > 5e8

        self.until(found)
        return (self.rested - since) / 1e9

    def largest_acceleration(self):
        """Of what the arm was told, by its own steps [rad/s²]."""
        rows = self.rows()
        return float(np.max(np.abs(np.diff(rows[:, 8:14], axis=0)))) / PERIOD

    def stop(self):
        for process in self.processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.send_signal(signal.SIGINT)
        for process in self.processes.values():
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
