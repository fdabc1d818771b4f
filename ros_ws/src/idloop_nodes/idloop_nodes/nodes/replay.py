"""Replay: plays a recording into the live graph, byte for byte, so that listeners see what they saw then."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from idloop.errors import InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.cdr import SECOND
from idloop.records.bags.topics import APPLIED_COMMAND, REQUESTED_COMMAND
from idloop_nodes.base import StreamNode
from idloop_nodes.codec import Level, Status, peek_stamp
from idloop_nodes.progress import DONE, END, BackPressure
from idloop_nodes.streams.rates import RateCounter
from idloop_nodes.topics import JOINT_STATE

BURST = 500  # messages in one go, so that services stay answered


class ReplayNode(StreamNode):
    """Publishes the chosen topics of a bag in the order of the bag."""

    poll_period = 0.001

    def __init__(self) -> None:
        super().__init__("replay")
        values = self.parameters
        if not values["bag"]:
            raise InputError("parameter bag: name the recording to play, -p bag:=FOLDER")
        self._bag = Path(values["bag"])
        if not self._bag.exists():
            raise InputError(f"no bag {self._bag}: check the path")
        self._messages = self._read(self._bag, set(values["topics"]))
        self._publish = {topic: self.publisher(topic) for topic in values["topics"]}
        self._next = next(self._messages, None)
        if self._next is None:
            raise InputError(f"bag {self._bag} holds none of {', '.join(values['topics'])} as joint states")
        self._start_ns = self._next[1]
        self._last_measurement = self._start_ns
        self._window = BackPressure(values["listeners"], self._window_ns())
        self._window.progress = self.progress
        self._began: float | None = None
        self._drain_until: float | None = None
        self._sent = RateCounter()

    def _read(self, bag: Path, topics: set[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield (topic, stamp, payload) in the order of the bag."""
        with Bag(bag) as opened:
            joints = {one.name: one for one in opened.topics.values() if one.type == JOINT_STATE}
            chosen: dict[str, str] = {}
            for name in joints:
                for topic in topics:
                    if name == topic or name.endswith("/" + topic):
                        chosen.setdefault(name, topic)
            # Behind a bridge the machine answered to the applied command.
            applied = [one.name for one in joints.values() if one.name.endswith(f"/{APPLIED_COMMAND}") and one.count]
            if applied and REQUESTED_COMMAND in topics:
                chosen = {name: topic for name, topic in chosen.items() if topic != REQUESTED_COMMAND}
                chosen |= dict.fromkeys(applied, REQUESTED_COMMAND)
            for name, _, payload in opened.messages(chosen):
                yield chosen[name], peek_stamp(payload), payload

    def _window_ns(self) -> int:
        """Return the window in time: the bag's own rate decides what a sample is."""
        stamps = []
        for topic, stamp, _ in self._read(self._bag, {"joint_states"}):
            if topic == "joint_states":
                stamps.append(stamp)
            if len(stamps) > 100:
                break
        period = (stamps[-1] - stamps[0]) // (len(stamps) - 1) if len(stamps) > 1 else SECOND // 1000
        return int(self.parameters["listener_window"]) * max(period, 1)

    def poll(self) -> None:
        """Publish what is due."""
        if self._drain_until is not None:
            timeout = self.parameters["drain_timeout"]
            if self._window.finished_by(self._drain_until, time.monotonic(), timeout):
                self.tell_progress(self._last_measurement, DONE)
                self.finished = True
        elif self._began is None:
            if self.start.peers_ready():
                self._began = time.monotonic()
        else:
            self._play(self._began)

    def _play(self, began: float) -> None:
        rate = self.parameters["rate"]
        for _ in range(BURST):
            if self._next is None:
                self._end()
                return
            topic, stamp, payload = self._next
            if rate > 0.0 and (stamp - self._start_ns) / SECOND > rate * (time.monotonic() - began):
                return
            if not self._window.open(stamp, self._start_ns):
                return
            self._publish[topic](payload)
            self._sent.count += 1
            if topic == "joint_states":
                self._last_measurement = stamp
            self._next = next(self._messages, None)

    def _end(self) -> None:
        self.tell_progress(self._last_measurement, END)
        self._drain_until = time.monotonic() + self.parameters["drain_timeout"]
        self.get_logger().info(f"end: {self._sent.count} messages of {self._bag}")

    def health(self) -> list[Status]:
        """Return how far the bag has been played."""
        values: dict[str, Any] = {"bag": str(self._bag), "sent": str(self._sent.count)}
        return [Status("playing", f"{self._sent.rate():.0f} messages/s", Level.OK, values)]


make = ReplayNode
