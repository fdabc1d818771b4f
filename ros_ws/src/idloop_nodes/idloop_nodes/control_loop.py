"""The controller node's controller and compensation from its parameters, and the streams that it follows."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from idloop.control import build_controller
from idloop.control.compensation import Compensation
from idloop.errors import InputError
from idloop.parameter_table import read_mapping
from idloop.physics import load_model
from idloop_nodes.codec import CdrError, JointReader
from idloop_nodes.codec.joints import output_columns
from idloop_nodes.streams.held_stream import HeldStream, PolledStream

if TYPE_CHECKING:
    from idloop.control import Controller
    from idloop.physics import Model
    from idloop_nodes.parameters import NodeParameters


COMPENSATION = ("limit", "velocity_width", "command_width", "crossing_time")


def controller_from_parameters(values: NodeParameters, model: Model) -> Controller:
    """Return the controller of the parameter `controller`, else of the model, with its compensation."""
    text = values["controller"]
    section = read_mapping(text, "controller", "{type: pid, kp: 1.0}") if text else model.controller
    specification: dict[str, Any] = {"sample_time": values["sample_time"], **(section or {"type": "none"})}
    return build_controller(specification, compensation=_compensation(values))


def _compensation(values: NodeParameters) -> Compensation | None:
    if not values["compensation"]:
        return None
    numbers = {name: values[f"compensation_{name}"] for name in COMPENSATION}
    return Compensation(load_model(values["compensation"]), tuple(values["compensation_effects"]), **numbers)


def compensated_effects(controller: Controller) -> str:
    """Return the names of the effects that the controller compensates; empty without compensation."""
    return ", ".join(one.active.name for one in controller.plan.cancelled) if controller.plan is not None else ""


def compensation_lines(controller: Controller) -> list[str]:
    """Return lines for the log: what is compensated, and what is not and why."""
    if controller.plan is None:
        return []
    left = controller.plan.left.items()
    return [
        f"cancels {compensated_effects(controller) or 'nothing'}",
        *(f"does not cancel {name}: {reason}" for name, reason in left),
    ]


def controller_columns(controller: Controller, model: Model) -> list[tuple[str, str]]:
    """Return joint and field of each measurement that the controller needs; InputError: one is no output."""
    known = {f"{joint}.{field}": (joint, field) for joint, field in output_columns(model)}
    missing = [name for name in controller.inputs if name not in known]
    if missing:
        raise InputError(f"controller: {missing[0]} is no output of model {model.name} ({', '.join(known)})")
    return [known[name] for name in controller.inputs]


class LoopInputs:
    """Takes messages of `reference` and `excitation` in and returns the values that hold."""

    def __init__(self, poll_topic: Callable[[str], PolledStream], used: dict[str, bool], period_ns: int) -> None:
        self.unreadable = 0  # messages that could not be read
        self._period_ns = period_ns
        self._reference, self._excitation = HeldStream(), HeldStream()
        # The joint's name is known from the first message: a reference may name any joint.
        readers = (
            ("reference", self._reference, JointReader([("*", "position"), ("*", "velocity")])),
            ("excitation", self._excitation, JointReader([("*", "position"), ("*", "effort")])),
        )
        # Both are always subscribed, so that the start barrier knows what to expect.
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
