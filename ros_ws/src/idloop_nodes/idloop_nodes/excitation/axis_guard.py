"""Watches the axis during an experiment."""

from __future__ import annotations

from collections.abc import Callable

from idloop_nodes.codec import CdrError, JointReader
from idloop_nodes.excitation.experiment import Limits
from idloop_nodes.streams.polled_stream import PolledStream


class AxisGuard:
    """Compares the measurements during an experiment with its limits.

    `poll_topic`: subscribes to a topic.
    """

    def __init__(self, poll_topic: Callable[[str], PolledStream], joint: str) -> None:
        self._poll_topic = poll_topic
        self._reader = JointReader([(joint, "position"), (joint, "velocity")])
        self._measurements: PolledStream | None = None

    def prepare(self, limits: Limits) -> None:
        """Subscribe to the measurements as soon as a limit needs them."""
        if limits.watched and self._measurements is None:
            self._measurements = self._poll_topic("joint_states")

    def breach(self, limits: Limits, span: tuple[int, int] | None) -> str:
        """Take in what has arrived; return which limit was exceeded in the span of an experiment, empty when none."""
        if self._measurements is None:
            return ""
        found = ""
        for data, _ in self._measurements.take():
            if span is None or found:
                continue
            try:
                stamp, (position, velocity) = self._reader.read(data)
            except CdrError:
                continue
            if span[0] <= stamp < span[1]:
                found = limits.breach(position, velocity)
        return found
