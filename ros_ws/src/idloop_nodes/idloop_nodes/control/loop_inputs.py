"""What a control loop follows: reference and excitation, looked up at the stamp of a measurement."""

from __future__ import annotations

import math
from collections.abc import Callable

from idloop_nodes.codec import CdrError, JointReader
from idloop_nodes.streams.held_stream import HeldStream
from idloop_nodes.streams.polled_stream import PolledStream


class LoopInputs:
    """Takes messages of `reference` and `excitation` in and returns the values that hold.

    `poll_topic`: subscribes to a topic; both are always subscribed, so that the start barrier knows what to expect.
    `used`: whether each of the two is used. `period_ns`: sample time [ns]. Attributes: `unreadable`: messages that
    could not be read.
    """

    def __init__(self, poll_topic: Callable[[str], PolledStream], used: dict[str, bool], period_ns: int) -> None:
        self.unreadable = 0
        self._period_ns = period_ns
        self._reference, self._excitation = HeldStream(), HeldStream()
        # The joint's name is known from the first message: a reference may name any joint.
        readers = (
            ("reference", self._reference, JointReader([("*", "position"), ("*", "velocity")])),
            ("excitation", self._excitation, JointReader([("*", "position"), ("*", "effort")])),
        )
        self._streams = [(topic, poll_topic(topic), held, reader) for topic, held, reader in readers]
        self._used = used

    def take(self) -> None:
        """Take in what has arrived."""
        for topic, stream, held, reader in self._streams:
            for data, _ in stream.take():
                if not self._used[topic]:
                    continue
                try:
                    held.push(*reader.read(data))
                except CdrError:
                    self.unreadable += 1

    def missing(self, stamp: int) -> list[str]:
        """Return the topics whose value at a stamp [ns] is not known yet."""
        return [
            stream.topic for topic, stream, held, _ in self._streams if self._used[topic] and not held.covers(stamp)
        ]

    def at(self, stamp: int) -> tuple[float, float, float]:
        """Return reference position, reference velocity and feed-forward command that hold at a stamp [ns]."""
        position = velocity = feedforward = 0.0
        reference = self._reference.at(stamp)
        if reference is not None:
            position, velocity = reference[1]
            velocity = 0.0 if math.isnan(velocity) else velocity
        excitation = self._excitation.at(stamp)
        # The last value of a stream that has stopped must not stay on the motor.
        if excitation is not None and stamp - excitation[0] < 2 * self._period_ns:
            shift, effort = excitation[1]
            position += 0.0 if math.isnan(shift) else shift
            feedforward = 0.0 if math.isnan(effort) else effort
        return position, velocity, feedforward
