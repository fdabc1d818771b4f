"""The controller: joint states and reference in, joint command out, zero whenever something is wrong."""

from __future__ import annotations

import math
import threading
import time

from idloop.physics import load_model
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import CdrError, JointReader, JointWriter, Level, Status, peek_stamp
from idloop_nodes.codec.joints import output_topic
from idloop_nodes.control_loop import (
    LoopInputs,
    compensated_effects,
    compensation_lines,
    controller_columns,
    controller_from_parameters,
)
from idloop_nodes.managed_node import EmergencyStop, ManagedNode
from idloop_nodes.streams.rates import RateCounter, StallNotice
from idloop_nodes.streams.stream_watch import JUMP_NS
from idloop_nodes.timing import Deadlines, become_urgent


class ControllerNode(ManagedNode):
    """Runs `idloop.control` sample by sample.

    Lock-step: each measurement is answered with a command of the same stamp. Real time: a thread with
    absolute deadlines computes from the newest measurement and stamps the command one period later.
    """

    poll_period = 0.005

    def __init__(self) -> None:
        super().__init__("controller")
        values = self.parameters
        model = load_model(values["model"])
        self._period_ns = round(values["sample_time"] * SECOND)
        self._controller = controller_from_parameters(values, model)
        for line in compensation_lines(self._controller):
            self.get_logger().info(line)
        self._reader = JointReader(controller_columns(self._controller, model))
        self._writer = JointWriter([model.input.joint], [model.input.field])
        self._lockstep = values["mode"] == "lockstep"
        self._pending: tuple[int, tuple[float, ...]] | None = None
        self._stall = StallNotice()
        self._last: int | None = None
        self._answer = b""
        self._lock = threading.Lock()
        self._sending = threading.Lock()
        self._sent_stamp = 0
        self._answers = RateCounter()
        self._saturated = 0
        self._jumps = 0
        self._silences = 0
        self._unreadable = 0
        self._publish = self.publisher(model.input.topic)
        used = {topic: values[f"use_{topic}"] for topic in ("reference", "excitation")}
        self._inputs = LoopInputs(self.poll_topic, used, self._period_ns)
        self._deadlines = Deadlines(self._period_ns)
        self._urgent = False
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._warm_up()
        if self._lockstep:
            self.listen(output_topic(model), self._on_measurement)
        else:
            self._measurements = self.poll_topic(output_topic(model))
            self._thread = self.thread(self._run_by_clock, "controller")
        self._emergency = EmergencyStop(self, self._lock, self._publish_zero, self._reset, "controller reset")
        self.start_by_itself()
        if self._thread is not None:
            self._thread.start()

    def _warm_up(self) -> None:
        """Compile before the first deadline."""
        self._controller.step(0.0, 0.0, [0.0] * len(self._controller.inputs))
        self._controller.reset()

    # lock-step

    def _on_measurement(self, data: bytes) -> None:
        try:
            stamp, measured = self._reader.read(data)
        except CdrError:
            self._unreadable += 1
            self._publish(self._writer.pack(peek_stamp(data), (0.0,)))
            return
        if stamp == self._last:  # a repetition: the answer did not arrive
            self._publish(self._answer)
            return
        self._pending = (stamp, measured)
        self._answer_pending()

    def _answer_pending(self) -> None:
        if self._pending is None:
            return
        stamp, measured = self._pending
        if self._inputs.missing(stamp):
            self._inputs.take()
            if self._inputs.missing(stamp):
                return
        self._pending = None
        self._answer = self._writer.pack(stamp, (self._compute(stamp, measured),))
        self._publish(self._answer)

    def poll(self) -> None:
        """Answer a measurement that had to wait for its reference."""
        super().poll()
        if self._lockstep:
            self._answer_pending()
            if self._stall.due(self._pending, time.monotonic()) and self._pending is not None:
                stamp = self._pending[0]
                missing = " and ".join(self._inputs.missing(stamp))
                self.get_logger().warning(f"waits for {missing} of {stamp / SECOND:.3f} s")

    # one sample

    def _compute(self, stamp: int, measured: tuple[float, ...]) -> float:
        """Return the command for a measurement; zero whenever the node may not move anything."""
        with self._lock:
            self._answers.count += 1
            if self._last is not None and not 0 < stamp - self._last < JUMP_NS:
                self._jumps += 1
                self._controller.reset()
                self._last = stamp
                return 0.0
            self._last = stamp
            if not self.active or self._emergency.latched:
                return 0.0
            position, velocity, feedforward = self._inputs.at(stamp)
            command = self._controller.step(position, velocity, measured, feedforward)
            self._saturated += self._controller.saturated
            return command if math.isfinite(command) else 0.0

    # real time

    def _send(self, stamp: int, command: float) -> None:
        """Publish with a stamp that never goes back, for loop, watchdog and services."""
        with self._sending:
            self._sent_stamp = max(stamp, self._sent_stamp + 1)
            self._publish(self._writer.pack(self._sent_stamp, (command,)))

    def _run_by_clock(self) -> None:
        self._urgent = become_urgent()
        deadlines = self._deadlines
        start = deadlines.start(phase=self.parameters["phase"])
        index, silent_since, silent = 0, start, False
        newest: tuple[int, tuple[float, ...]] | None = None
        while not self._stop.is_set():
            now = deadlines.wait(index)
            # After an overrun the deadlines that have passed are counted, not worked off.
            index = max(index, (now - start) // self._period_ns) + 1
            fresh = False
            for data, _ in self._measurements.take():
                try:
                    newest, fresh = self._reader.read(data), True
                except CdrError:
                    self._unreadable += 1
            self._inputs.take()
            if fresh and newest is not None:
                if silent:
                    self._controller.reset()
                silent_since, silent = now, False
                command = self._compute(*newest)
                self._send(newest[0] + self._period_ns, command)
            elif now - silent_since > self.parameters["watchdog"] * SECOND:
                self._silences += not silent and newest is not None
                silent = True
                self._send(now, 0.0)

    # lifecycle, services, health

    def deactivated(self) -> None:
        """Publish a zero command at once."""
        self._controller.reset()
        self._publish_zero()

    def activated(self) -> None:
        """Start without any memory."""
        self._controller.reset()

    def _publish_zero(self) -> None:
        """Zero command outside the loop's rhythm; in lock-step the answers themselves are zero."""
        if not self._lockstep:
            self._send(time.time_ns(), 0.0)

    def _reset(self) -> str:
        self._controller.reset()
        return ""

    def thread_failed(self) -> None:
        """Publish a zero command at once."""
        self._publish_zero()

    def close(self) -> None:
        """Leave a zero command behind."""
        self._stop.set()
        if self._thread is not None and self._thread.is_alive():
            self._thread.join(timeout=1.0)
        self._publish_zero()

    def health(self) -> list[Status]:
        """Return loop and safety state."""
        rate = self._answers.rate()
        fault = self._emergency.latched or self._controller.fault or ""
        unreadable = self._unreadable + self._inputs.unreadable
        loop = {
            "answers": str(self._answers.count),
            "rate": f"{rate:.1f}",
            "saturated": str(self._saturated),
            "missed_deadlines": str(self._deadlines.missed),
            "silences": str(self._silences),
            "real_time_priority": str(self._urgent).lower(),
            "clock_jumps": str(self._jumps),
            "unreadable": str(unreadable),
            "cancels": compensated_effects(self._controller),
        }
        level = Level.WARN if self._deadlines.missed + self._silences + self._jumps + unreadable else Level.OK
        state = fault or ("active" if self.active else "inactive: zero command")
        return [
            Status("loop", f"{rate:.0f} commands/s", level, loop),
            Status("safety", state, Level.ERROR if fault else Level.OK, {"active": str(self.active).lower()}),
        ]


make = ControllerNode
