"""The whole live graph on a robot: robot, excitation, controller, bridge, estimator and recorder, as processes.

What the robot measured and was told is in its own log; what the recorder kept is held against that.
"""

from __future__ import annotations

import contextlib
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rclpy
from numpy.typing import NDArray
from outcome import Outcome
from robot_graph import LOOP, PATIENCE, RobotGraph
from sensor_msgs.msg import JointState

from idloop.errors import IdloopError
from idloop.records import read_streams
from idloop.records.bags.recover import recover_bag
from idloop.records.bags.storage.readable_messages import mcap_messages
from idloop_nodes import qos
from idloop_nodes.codec import peek_stamp
from idloop_nodes.streams.bag_writer import CHUNK_SIZE

WATCHERS = {
    "estimator": LOOP | {"window": 2.0, "validation": 1.0, "fit_period": 3.0, "auto_diagnose": False},
    "recorder": LOOP,
}
# What may be on its way to the disk beside the last chunk: one poll of the recorder on a busy machine [s].
ON_ITS_WAY = 0.2
EDGE = 0.25  # a fault and its end are known to this much [s]


@dataclass(frozen=True)
class Kept:
    """What a recording has of what the robot measured until an instant.

    Attributes
    ----------
    holes : int
        Measurements that are missing before the last one that is there, outside of known interruptions.
    tail : float
        Age of the last one at that instant [s].
    chunk : float
        Seconds of recording in one chunk.
    """

    holes: int
    tail: float
    chunk: float

    def judge(self, found: Outcome, allowed: float = ON_ITS_WAY) -> None:
        """Write into an outcome what is wrong with it."""
        if self.tail == np.inf:
            found.wrong.append("nothing of the recording is left")
        elif self.tail > self.chunk + allowed:
            found.late.append(f"the last {1e3 * self.tail:.0f} ms are lost, a chunk is {1e3 * self.chunk:.0f} ms")
        if self.holes:
            found.wrong.append(f"{self.holes} measurements missing within the recording")


class LiveGraph(RobotGraph):
    """The graph of the bridge's tests with an estimator, a recorder and a listener beside it.

    Parameters
    ----------
    folder : Path
        Logs and recordings go here.
    prefixes : mapping of str to sequence of str, optional
        Words before the command line of a process, by its name.
    """

    def __init__(self, folder: Path, prefixes: Mapping[str, Sequence[str]] | None = None) -> None:
        self.prefixes = dict(prefixes or {})
        self.bag = folder / "bag_0"
        self.number = 0
        self._seen: Path | None = None
        self.windows: list[tuple[int, int]] = []
        super().__init__(folder, {}, WATCHERS)
        self.listener = Listener()

    def _popen(self, name: str, words: list[str]):  # noqa: ANN202 (as the parent)
        return super()._popen(name, [*self.prefixes.get(name, ()), *words])

    def start(self, name: str, bag: Path | None = None) -> None:
        """Start a node; every recorder gets a bag of its own."""
        if name == "robot":
            self.start_robot()
            return
        if name == "recorder":
            self.number += 1
            self.bag = bag or self.folder / f"bag_{self.number}"
            self.parameters["recorder"]["bag"] = self.bag
            self.mark = len(self.said("recorder")) if (self.folder / "recorder.txt").exists() else 0
        super().start(name)

    def last_words(self, name: str) -> list[str]:
        """Lines that the newest process of a node has said; the recorder's only."""
        return [line for line in self.said(name)[self.mark :].splitlines() if line]

    def lines(self) -> int:
        """Number of lines in the robot's log."""
        return len(self._rows())

    # alive

    def until_alive(self) -> None:
        """Wait until the motor is driven, every sample is predicted, and the recording grows."""
        self.until_driven()
        heard = self.listener.count
        self.until(lambda: self.listener.count > heard + 10)
        size = self.recorded()
        self.until(lambda: self.recorded() > size)
        # A recorder that has just joined may not have found the bridge yet.
        self.until(self.measured)

    def measured(self) -> bool:
        """Whether the recording has a measurement in it."""
        if self.bag != self._seen:
            topics = (one.channel.topic for file in self.bag.glob("*.mcap") for one in mcap_messages(file) if one)
            self._seen = self.bag if "/joint_states" in topics else None
        return self._seen is not None

    def recorded(self) -> int:
        """Size of the recording [bytes]."""
        with contextlib.suppress(OSError):
            return sum(file.stat().st_size for file in self.bag.glob("*.mcap"))
        return 0

    def interrupted(self, since: int) -> None:
        """Remember that measurements may be missing from an instant until now."""
        self.windows.append((since - round(EDGE * 1e9), time.monotonic_ns() + round(EDGE * 1e9)))

    # what was kept

    def kept(self, until: int, bag: Path | None = None, *, whole: bool = False) -> Kept:
        """Hold a recording against what the robot had measured until an instant of the steady clock."""
        bag = bag or self.bag
        size = max(sum(file.stat().st_size for file in bag.glob("*.mcap")), 1)
        stamps = _stamps(bag, whole)
        sent = np.array([row for row in self.sent() if row[0] <= until], dtype=np.int64).reshape(-1, 2)
        if not stamps.size:
            return Kept(0, np.inf, 0.0)
        there = np.isin(sent[:, 1], stamps)
        if not there.any():
            return Kept(0, np.inf, 0.0)
        first, last = np.flatnonzero(there)[[0, -1]]
        span = (sent[last, 0] - sent[first, 0]) / 1e9
        missing = ~there
        missing[:first] = missing[last:] = False
        for begin, end in self.windows:
            missing &= ~((sent[:, 0] >= begin) & (sent[:, 0] <= end))
        return Kept(int(missing.sum()), (until - int(sent[last, 0])) / 1e9, CHUNK_SIZE * span / size)

    def end_recorder(self, found: Outcome) -> None:
        """End the recorder as Ctrl-C does; write into an outcome what is wrong with its recording."""
        process = self.processes["recorder"]
        process.send_signal(signal.SIGINT)
        until = time.monotonic_ns()
        code = process.wait(timeout=PATIENCE)
        if code != 0:
            found.wrong.append(f"the recorder ended with {code}: {self.last_words('recorder')[-1:]}")
        self.kept(until, whole=True).judge(found)

    def stop(self) -> None:
        """End everything."""
        self.listener.close()
        super().stop()


def _stamps(bag: Path, whole: bool) -> NDArray[np.int64]:
    """Stamps of the measurements in a recording; one that is cut off is recovered first."""
    with tempfile.TemporaryDirectory() as folder:
        if not whole:
            saved = Path(folder) / "saved"
            try:
                recover_bag(bag, saved)
            except IdloopError:
                return np.array([], dtype=np.int64)
            bag = saved
        streams = read_streams(bag)
        return streams["/joint_states"].stamp_ns if "/joint_states" in streams else np.array([], dtype=np.int64)


class Listener:
    """A node of our own in the graph: counts predictions, and speaks where a stranger would."""

    def __init__(self) -> None:
        self.count = 0
        self.newest = 0
        self.context = rclpy.Context()
        self.context.init()
        self.node = rclpy.create_node("listener", context=self.context)
        self.node.create_subscription(JointState, "estimator/prediction", self._hear, qos.stream(), raw=True)
        self._publishers: dict[str, object] = {}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _hear(self, data: bytes) -> None:
        self.count += 1
        self.newest = peek_stamp(data)

    def _spin(self) -> None:
        executor = rclpy.executors.SingleThreadedExecutor(context=self.context)
        executor.add_node(self.node)
        while not self._ended.is_set():
            executor.spin_once(timeout_sec=0.05)
        executor.shutdown()

    @contextlib.contextmanager
    def stranger(self, topic: str) -> Iterator[Callable[[bytes], None]]:
        """A publisher where there should be none."""
        publisher = self.node.create_publisher(JointState, topic, qos.stream(100))
        try:
            yield publisher.publish
        finally:
            self.node.destroy_publisher(publisher)

    def close(self) -> None:
        """Leave the graph."""
        self._ended.set()
        self._thread.join()
        self.node.destroy_node()
        self.context.try_shutdown()


def environment(folder: Path, domain: int) -> None:
    """Set the environment of this process and its children: own domain, logs in a folder of ours."""
    os.environ |= {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_LOG_DIR": str(folder / "ros_log"),
    }
