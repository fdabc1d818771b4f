"""The simulated machine: takes joint commands, answers with joint states."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from idloop.errors import IdloopError
from idloop.physics import Machine, Plant, load_model
from idloop.records.bags.cdr import SECOND
from idloop_nodes.base import StreamNode
from idloop_nodes.codec import CdrError, JointReader, Level, Status, encode_time
from idloop_nodes.codec.joints import OutputPacker, output_columns, output_topic
from idloop_nodes.descriptions import describe
from idloop_nodes.graph_start import RUNNING_PEER_FACTOR
from idloop_nodes.parameters import NodeParameters
from idloop_nodes.progress import DONE, END, BackPressure
from idloop_nodes.streams.rates import FIRST_TIMEOUT, TIMEOUT, RateCounter, StallNotice
from idloop_nodes.streams.stream_watch import effective_time
from idloop_nodes.timing import Deadlines, Pace, become_urgent

REPEAT = 1.0  # seconds without an answer, in lock-step, after which a measurement is published again


def simulated(values: NodeParameters) -> Plant:
    """Build the machine of the parameters `model` and `effects`."""
    return Plant(
        load_model(values["model"]).with_effects(values["effects"]),
        seed=values["seed"],
        noise=values["noise"],
        disturbance_std=values["disturbance_std"],
        disturbance_time_constant=values["disturbance_time_constant"],
    )


class PlantNode(StreamNode):
    """Steps the machine that `build` makes: when the command arrives (lock-step) or by the clock (real time)."""

    poll_period = 0.005

    def __init__(self, kind: str, build: Callable[[NodeParameters], Machine]) -> None:
        super().__init__("plant", describe(kind).parameters())
        values = self.parameters
        self._plant = build(values)
        model = self._plant.model
        self._period: float = values["sample_time"]
        self._period_ns: int = round(self._period * SECOND)
        self._samples = round(values["duration"] / self._period) or None
        self._packer = OutputPacker(output_columns(model))
        self._reader = JointReader([(model.input.joint, model.input.field)])
        self._start_ns: int = round(values["start_time"] * SECOND)
        self._index = 0
        self._running, self._started = False, 0.0
        self._held_back: bytes | None = None
        self._newest, self._sent = b"", 0.0
        self._drain_until: float | None = None
        self._steps = RateCounter()
        self._wrong_stamps = 0
        self._late_commands = 0
        self._bad_commands = 0
        self._pace = Pace(values["real_time_factor"])
        self._clock_every = max(1, round(1.0 / (values["clock_rate"] * self._period)))
        self._lockstep = values["mode"] == "lockstep"
        window_ns = values["listener_window"] * self._period_ns
        self._window = BackPressure(values["listeners"], window_ns, first_alone=self._lockstep)
        self._window.progress = self.progress
        self._stall = StallNotice()
        self._publish = self.publisher(output_topic(model))
        if self._lockstep:
            self._publish_clock = self.publisher("/clock")
            self.listen(model.input.topic, self._on_command)
        else:
            self._commands = self.poll_topic(model.input.topic)
            self._urgent = False
            self._deadlines = Deadlines(self._period_ns)
            self._stop = threading.Event()
            self._thread = self.thread(self._run_by_clock, "plant")
        self._plant.measure()  # compiles before the clock runs
        self._plant.reset()

    # lock-step

    def poll(self) -> None:
        """Start when all peers are ready, continue when slow listeners have caught up, end when they are done."""
        if not self._running:
            if self._drain_until is not None:
                timeout = self.parameters["drain_timeout"]
                if self._window.finished_by(self._drain_until, time.monotonic(), timeout):
                    self.tell_progress(self._stamp() - self._period_ns, DONE)
                    self.finished = True
            elif self.start.peers_ready() and self._partners():
                self._begin()
        elif self._lockstep:
            if self._held_back is not None:
                self._send(self._held_back)
            unanswered = self._held_back is None or self._window.unconfirmed()
            if unanswered and time.monotonic() - self._sent > REPEAT:
                self._repeat_measurement()
            self._report_stall()

    def _repeat_measurement(self) -> None:
        """Publish the newest measurement again: a node that has not received it would hold up the graph for ever."""
        self._sent = time.monotonic()
        self._publish_clock(encode_time(self._stamp()))
        self._publish(self._newest)

    def _report_stall(self) -> None:
        held = self._held_back is not None
        unconfirmed = self._window.unconfirmed() if held else []
        if self._stall.due((self._index, held), time.monotonic(), FIRST_TIMEOUT if unconfirmed else TIMEOUT):
            who = ", ".join(self._window.slow(self._stamp(), self._start_ns)) if held else "the controller"
            first = ", which confirmed no sample yet" if unconfirmed else ""
            self.get_logger().warning(f"waits for {who} at {self._index * self._period:.3f} s of simulated time{first}")
        limit = RUNNING_PEER_FACTOR * self.parameters["start_timeout"]
        if unconfirmed and time.monotonic() - self._started > limit:
            raise IdloopError(f"{', '.join(unconfirmed)} confirmed no sample within {limit:g} s; start the graph again")

    def _partners(self) -> bool:
        """Without named peers: whether there is a reader of the measurements and a sender of commands."""
        if self.others:
            return True
        model = self._plant.model
        readers = self.publishers_by_topic[output_topic(model)].get_subscription_count()
        return bool(readers and self.subscriptions_by_topic[model.input.topic].get_publisher_count())

    def _begin(self) -> None:
        self._running, self._started = True, time.monotonic()
        self.tell_progress(self._start_ns)  # a listener that receives this and no measurement subscribes again
        self.get_logger().info(f"start: {self._plant.model.name}, {1.0 / self._period:g} Hz, {self.parameters['mode']}")
        if self._lockstep:
            self._measure()
        else:
            self._thread.start()

    def _stamp(self) -> int:
        return self._start_ns + self._index * self._period_ns

    def _measure(self) -> None:
        stamp = self._stamp()
        if self._index % self._clock_every == 0:
            self._publish_clock(encode_time(stamp))
        self._send(self._packer.pack(stamp, self._plant.measure().tolist()))

    def _send(self, message: bytes) -> None:
        caught_up = self._window.open(self._stamp(), self._start_ns)
        if caught_up and not self._pace.early(self._index * self._period, time.monotonic()):
            self._held_back = None
            self._sent, self._newest = time.monotonic(), message
            self._publish(message)
        else:
            self._window.waits += self._held_back is None and not caught_up
            self._held_back = message

    def _on_command(self, data: bytes) -> None:
        stamp, (command,) = self._reader.read(data)
        if stamp != self._stamp() or not self._running or self._held_back is not None:
            self._wrong_stamps += 1
            return
        self._index += 1
        self._plant.step(command, self._index * self._period)
        self._steps.count += 1
        if self._index == self._samples:
            self._end()
        else:
            self._measure()

    def _end(self) -> None:
        last = self._start_ns + (self._index - 1) * self._period_ns
        self.tell_progress(last, END)
        self._drain_until = time.monotonic() + self.parameters["drain_timeout"]
        self._running = False  # only now: in real time `poll` runs beside this, and would start the run again
        self.get_logger().info(f"end: {self._index} samples, waited {self._window.waits} times for listeners")

    # real time

    def _run_by_clock(self) -> None:
        """Measure at every deadline; commands act at their stamps, late ones on arrival."""
        self._urgent = become_urgent()
        deadlines = self._deadlines
        self._start_ns = deadlines.start()
        applied = 0
        last_command = self._start_ns
        while not self._stop.is_set():
            now = deadlines.wait(self._index)
            for data, information in self._commands.take():
                try:
                    stamp, (command,) = self._reader.read(data)
                    when = effective_time(stamp, information.get("received_timestamp") or now, now)
                    self._plant.schedule((when - self._start_ns) / SECOND, command)
                except (CdrError, IdloopError):
                    self._bad_commands += 1
                    continue
                self._late_commands += when > stamp
                last_command, applied = now, applied + 1
            if applied and now - last_command > self.parameters["command_timeout"] * SECOND:
                self._plant.schedule(self._plant.time, 0.0)
                applied = 0
            self._plant.advance(self._index * self._period)
            self._publish(self._packer.pack(self._stamp(), self._plant.measure().tolist()))
            self._steps.count += 1
            self._index += 1
            if self._index == self._samples:
                self._end()
                return

    def close(self) -> None:
        """Stop the deadline thread."""
        if not self._lockstep:
            self._stop.set()
            if self._thread.is_alive():
                self._thread.join(timeout=1.0)

    def health(self) -> list[Status]:
        """Return rate, misplaced and late commands, and who holds the loop back."""
        rate = self._steps.rate()
        values = {
            "steps": str(self._steps.count),
            "rate": f"{rate:.1f}",
            "mode": self.parameters["mode"],
            "misplaced_commands": str(self._wrong_stamps),
            "late_commands": str(self._late_commands),
            "bad_commands": str(self._bad_commands),
            "waits_for_listeners": str(self._window.waits),
        }
        bad = self._wrong_stamps + self._bad_commands
        if not self._lockstep:
            values["real_time_priority"] = str(self._urgent).lower()
            values["missed_deadlines"] = str(self._deadlines.missed)
            bad += self._deadlines.missed
        level = Level.WARN if bad else Level.OK
        state = f"{rate:.0f} steps/s" if self._running else "waiting for peers" if not self._index else "at the end"
        return [Status("loop", state, level, values)]


def make() -> PlantNode:
    """Build the node."""
    return PlantNode("plant", simulated)
