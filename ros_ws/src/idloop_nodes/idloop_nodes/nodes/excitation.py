"""The excitation: builds the whole signal once and publishes it ahead of the clock."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from std_srvs.srv import Trigger

from idloop.errors import InputError
from idloop.signals import SIGNALS, build_signal
from idloop_nodes.base import ManagedNode
from idloop_nodes.codec import JointWriter, Level, Status, peek_stamp
from idloop_nodes.parameters import Values
from idloop_nodes.rates import RateCounter
from idloop_nodes.tables import excitation_table

SECOND = 1_000_000_000
BURST = 1000  # samples published at most in one go, so that services stay answered


class ExcitationNode(ManagedNode):
    """Publishes `reference` or `excitation`, each sample stamped with the time at which it holds."""

    def __init__(self) -> None:
        super().__init__("excitation", excitation_table())
        values = self.parameters
        self._target = values["target"]
        self._reference = self._target == "reference"
        self._period_ns = round(values["sample_time"] * SECOND)
        self._ahead_ns = values["ahead"] * self._period_ns
        self._lockstep = values["mode"] == "lockstep"
        self.poll_period = 0.2 if self._lockstep else min(0.005, 0.25 * values["ahead"] * values["sample_time"])
        fields = ("position", "velocity") if self._reference else (self._target,)
        self._writer = JointWriter([values["joint"]], fields)
        both = {topic: self.publisher(topic) for topic in ("reference", "excitation")}
        self._publish = both["reference" if self._reference else "excitation"]
        self._now: int | None = None
        self._next: int | None = None
        self._index = 0
        self._sent = RateCounter()
        self._position, self._velocity = self._build(values.values)
        values.check = self._refuse_while_active
        values.apply = lambda names: self._rebuild()
        if self._lockstep:
            self.listen("/clock", self._on_clock)
        self.create_service(Trigger, "~/start", self._on_start)
        self.create_service(Trigger, "~/stop", self._on_stop)
        self.start_by_itself()

    def _build(self, values: Values) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return value and rate of the whole signal, each (n,)."""
        kind = values["signal"]
        own = {spec.name: values[f"{kind}.{spec.name}"] for spec in SIGNALS[kind].parameters}
        common = {name: values[name] for name in ("sample_time", "duration", "amplitude", "offset", "seed", "ramp_in")}
        given = {name: value for name, value in (own | common).items() if value is not None}
        signal = build_signal(kind, **given)
        rate = np.zeros_like(signal.value) if signal.rate is None else signal.rate
        return signal.value, rate

    def _refuse_while_active(self, values: Values) -> None:
        if self.active:
            raise InputError("the signal cannot change while it runs: call ~/stop (or deactivate) first")
        self._build(values)

    def _rebuild(self) -> None:
        self._position, self._velocity = self._build(self.parameters.values)
        self._index = 0

    # lifecycle and services

    def activated(self) -> None:
        """Start the signal at the next sample that is not yet out."""
        self._index = 0

    def deactivated(self) -> None:
        """Take back what was announced: everything from now on is neutral."""
        if self._now is not None:
            self._next = self._now + self._period_ns
            self._publish_ahead(self._now)

    def _on_start(self, request: Any, response: Any) -> Any:
        self.bring_up()
        response.success, response.message = self.active, "running" if self.active else "not started"
        return response

    def _on_stop(self, request: Any, response: Any) -> Any:
        if self.active:
            self.trigger_deactivate()
        response.success, response.message = not self.active, "stopped: neutral values from the next sample on"
        return response

    # time

    def _on_clock(self, data: bytes) -> None:
        self._publish_ahead(peek_stamp(data))

    def poll(self) -> None:
        """Real time: follow the system clock on whole periods of it."""
        super().poll()
        if not self._lockstep:
            self._publish_ahead(time.time_ns() // self._period_ns * self._period_ns)

    def _publish_ahead(self, now: int) -> None:
        if self._now is not None and now < self._now:
            self._next = None  # the clock was set back: a new run begins
            self._index = 0
        self._now = now
        if self._next is None or self._next < now - self._ahead_ns:
            self._next = now
        for _ in range(BURST):
            if self._next > now + self._ahead_ns:
                return
            self._publish(self._sample(self._next))
            self._next += self._period_ns
            self._sent.count += 1

    def _sample(self, stamp: int) -> bytes:
        position, velocity = self._value()
        if self._reference:
            return self._writer.pack(stamp, (position,), (velocity,))
        return self._writer.pack(stamp, (position,))

    def _value(self) -> tuple[float, float]:
        """Next value: the signal while active, then its end (reference) or zero (excitation)."""
        index, last = self._index, len(self._position) - 1
        if self.active and index <= last:
            self._index += 1
            return float(self._position[index]), float(self._velocity[index])
        if not self._reference or index == 0:
            return 0.0, 0.0
        return float(self._position[min(index, last + 1) - 1]), 0.0

    def health(self) -> list[Status]:
        """Return where the signal stands."""
        done = min(self._index, len(self._position))
        values = {
            "signal": self.parameters["signal"],
            "samples": str(len(self._position)),
            "sent_of_signal": str(done),
            "published": str(self._sent.count),
            "rate": f"{self._sent.rate():.1f}",
            "active": str(self.active).lower(),
        }
        text = f"{self.parameters['signal']}: {100.0 * done / len(self._position):.0f} %"
        return [Status("signal", text if self.active else "inactive", Level.OK, values)]


def make() -> ExcitationNode:
    """Build the node."""
    return ExcitationNode()
