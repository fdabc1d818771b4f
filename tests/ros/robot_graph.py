"""A robot and the graph that drives it through the bridge, as processes; what the robot was told is in its log."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from itertools import groupby, takewhile
from operator import itemgetter
from pathlib import Path

from idloop.graph.command import node_environment

PATIENCE = 300.0  # a busy machine takes its time to start a node
ZEROS = 20  # so many zero commands in a row are a stop
LOOP = {"mode": "realtime", "sample_time": 0.005}
NODES = {
    "excitation": LOOP | {"signal": "constant", "target": "effort", "amplitude": 1.5, "duration": 3600.0, "ahead": 10},
    "controller": LOOP | {"controller": "'{type: none}'", "use_reference": False, "use_excitation": True},
    "bridge": {
        "robot_states": "/robot/joint_states",
        "robot_commands": "/robot/commands",
        "robot_joints": "['elbow']",
        "joints": "['motor']",
        "controller_joints": "['wrist', 'elbow', 'shoulder']",
        "limit.command": 2.0,
        "limit.velocity": 20.0,
        "soft_start": 0.1,
    },
    "guardian": {},
}


class RobotGraph:
    """Excitation, controller, bridge and robot as processes, and an own node among them."""

    def __init__(self, folder: Path, bridge, more=None):
        self.folder = folder
        self.log = folder / "robot.log"
        self.environment = node_environment()
        self.parameters = {name: dict(values) for name, values in (NODES | (more or {})).items()}
        self.parameters["bridge"] |= bridge
        self.processes = {}
        self.start_robot()
        for name in self.parameters:
            self.start(name)

    def _popen(self, name, words):
        if name in self.processes:
            self.processes[name].stdin.close()
        with (self.folder / f"{name}.txt").open("a", encoding="utf-8") as said:
            self.processes[name] = subprocess.Popen(
                words, env=self.environment, stdin=subprocess.PIPE, stdout=said, stderr=subprocess.STDOUT, text=True
            )
        return self.processes[name]

    def start_robot(self):
        self.log.unlink(missing_ok=True)
        self.rows, self.read_to = [], 0
        script = Path(__file__).with_name("robot.py")
        self.robot = self._popen("robot", [sys.executable, str(script), str(self.log), str(LOOP["sample_time"])])

    def end_robot(self):
        if self.robot.poll() is None:
            self.robot.stdin.write("end\n")
            self.robot.stdin.flush()
        self._end(self.robot)

    def said(self, name):
        return (self.folder / f"{name}.txt").read_text(encoding="utf-8")

    def start(self, name):
        words = [word for key, value in self.parameters[name].items() for word in ("-p", f"{key}:={value}")]
        self._popen(name, [sys.executable, "-m", "idloop_nodes", name, "--ros-args", *words])

    def order(self, *words):
        """Tell the robot what to be; return the steady time at which it took the order."""
        before = len(self.obeyed())
        self.robot.stdin.write(" ".join(map(str, words)) + "\n")
        self.robot.stdin.flush()
        self.until(lambda: len(self.obeyed()) > before)
        return self.obeyed()[-1]

    def signal(self, name, number):
        """Send a signal to a node; return the steady time at which it had been sent."""
        self.processes[name].send_signal(number)
        return time.monotonic_ns()

    def _rows(self):
        """What the robot has written, split into words; only what is new is read."""
        if not self.log.exists():
            return []
        with self.log.open(encoding="utf-8") as file:
            file.seek(self.read_to)
            whole, end, _ = file.read().rpartition("\n")
        self.read_to += len((whole + end).encode())
        self.rows += [line.split() for line in whole.splitlines()]
        return self.rows

    def told(self, since=0):
        """(steady time, command, position) of everything that the robot was told after an instant."""
        return [
            (int(row[0]), float(row[2]), float(row[3]))
            for row in takewhile(lambda row: int(row[0]) > since, reversed(self._rows()))
            if row[1] == "command"
        ][::-1]

    def newest(self):
        """The newest of what the robot was told."""
        return next(
            (int(row[0]), float(row[2]), float(row[3])) for row in reversed(self._rows()) if row[1] == "command"
        )

    def sent(self):
        """(steady time, stamp) of every measurement."""
        return [(int(row[0]), int(row[2])) for row in self._rows() if row[1] == "sent"]

    def obeyed(self):
        """Steady times at which the robot took the orders."""
        return [int(row[0]) for row in self._rows() if row[1] == "order"]

    def until(self, condition):
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, ({name: self.said(name)[-300:] for name in self.processes}, self.rows[-3:])
            threading.Event().wait(0.01)

    def until_driven(self):
        """Wait until full commands pass; return the time."""
        since = time.monotonic_ns()
        self.until(lambda: any(command == 1.5 for _, command, _ in self.told(since)[-3:]))
        return time.monotonic_ns()

    def until_zero_after(self, since, count=ZEROS):
        """Wait until the robot has been told zero after an instant, so many times in a row.

        Returns
        -------
        float
            Seconds from the last command that was none to the first zero, by the robot's steady clock.
        """
        self.until(lambda: self._zeros(since, count) is not None)
        first = self._zeros(since, count)
        last = [time_ns for time_ns, command, _ in self.told() if time_ns < first and command != 0.0][-1]
        return (first - last) / 1e9

    def first_zero_after(self, since):
        """Seconds from an instant to the first zero that the robot was told after it."""
        return next(time_ns - since for time_ns, command, _ in self.told(since) if command == 0.0) / 1e9

    def _zeros(self, since, count):
        """Time of the first of so many zeros in a row."""
        for command, rows in groupby(self.told(since), key=itemgetter(1)):
            run = list(rows)
            if command == 0.0 and len(run) >= count:
                return run[0][0]
        return None

    def still(self, since):
        """Whether the robot was told nothing but zero after an instant, up to now."""
        return {command for _, command, _ in self.told(since)} == {0.0}

    def stop(self):
        self.end_robot()
        for name, process in self.processes.items():
            if process.poll() is None and name != "robot":
                process.send_signal(signal.SIGCONT)
                process.send_signal(signal.SIGINT)
        for process in self.processes.values():
            self._end(process)

    @staticmethod
    def _end(process):
        try:
            process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stdin.close()
