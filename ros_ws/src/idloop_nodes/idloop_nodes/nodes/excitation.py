"""The excitation: builds the whole signal once and publishes it ahead of the clock; plays experiments between."""

from __future__ import annotations

import time
from collections import deque

from rclpy.parameter import Parameter

from idloop.errors import InputError
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import JointWriter, Level, Status, peek_stamp
from idloop_nodes.excitation.excitation_sequence import ExcitationSequence
from idloop_nodes.excitation.experiment import (
    LIMITS,
    AxisGuard,
    experiment_limits,
    normal_signal,
    read_experiment,
    return_time,
)
from idloop_nodes.managed_node import ManagedNode
from idloop_nodes.parameters import Values
from idloop_nodes.progress import EXPERIMENT, HANDED_BACK
from idloop_nodes.streams.rates import RateCounter

BURST = 1000  # samples published at most in one go, so that services stay answered
QUIET = 0.5  # seconds without a sample after which a clock that stands still makes them published again
# May change while the normal signal runs.
FOR_EXPERIMENTS = frozenset({"experiment", "handover_time", "rest_time", *(f"limit.{name}" for name in LIMITS)})


class ExcitationNode(ManagedNode):
    """Publishes `reference` or `excitation`, each sample stamped with the time at which it holds."""

    def __init__(self) -> None:
        super().__init__("excitation")
        values = self.parameters
        self._target = values["target"]
        self._reference = self._target == "reference"
        self._period_ns = round(values["sample_time"] * SECOND)
        self._ahead_ns = values["ahead"] * self._period_ns
        self._lockstep = values["mode"] == "lockstep"
        self.scheduling = "batch" if self._lockstep else "normal"
        self.poll_period = 0.2 if self._lockstep else min(0.005, 0.25 * values["ahead"] * values["sample_time"])
        fields = ("position", "velocity") if self._reference else (self._target,)
        self._writer = JointWriter([values["joint"]], fields)
        both = {topic: self.publisher(topic) for topic in ("reference", "excitation")}
        self._publish = both["reference" if self._reference else "excitation"]
        self._now: int | None = None
        self._next: int | None = None
        self._recent: deque[bytes] = deque(maxlen=values["ahead"] + 1)  # what holds from now on
        self._published_at = 0.0
        self._sent = RateCounter()
        self._experiments = 0
        self._reported_span: tuple[int, int] | None = None
        self._breach = ""
        self._own_limit: float | None = None
        self._sequence = ExcitationSequence(
            *normal_signal(values.values),
            self._period_ns,
            keeps=self._reference,
            ahead=values["ahead"],
            repeats=return_time(values.values),
        )
        self._axis = AxisGuard(self.poll_topic, values["joint"])
        self._axis.prepare(experiment_limits(values.values))
        values.check = self._check
        values.apply = self._apply
        self._choose_limit()
        if self._lockstep:
            self.listen("/clock", self._on_clock)
        self.offer("~/start", self._start_signal)
        self.offer("~/stop", self._stop_signal)
        self.offer("~/run_experiment", self._begin_experiment)
        self.offer("~/stop_experiment", self._stop_experiment)
        self.start_by_itself()

    # parameters

    def _choose_limit(self) -> None:
        """Without a limit of the user, an experiment stays within the normal signal; the parameter shows it."""
        if self.parameters["limit.amplitude"] in (None, self._own_limit):
            self._own_limit = self._sequence.peak
            self.set_parameters([Parameter("limit.amplitude", value=self._own_limit)])

    def _check(self, values: Values) -> None:
        changed = {name for name, value in values.items() if value != self.parameters[name]}
        if changed & FOR_EXPERIMENTS and self._sequence.playing:
            raise InputError("an experiment is running: call ~/stop_experiment (or ~/stop) first")
        if changed - FOR_EXPERIMENTS:
            if self.active:
                raise InputError("the signal cannot change while it runs: call ~/stop (or deactivate) first")
            normal_signal(values)
        if "experiment" in changed and values["experiment"]:
            experiment = read_experiment(values["experiment"], self._target, values["sample_time"])
            experiment_limits(values).refuse(experiment)

    def _apply(self, names: set[str]) -> None:
        if names - FOR_EXPERIMENTS:
            self._sequence.load(*normal_signal(self.parameters.values))
            self._sequence.repeats = return_time(self.parameters.values)
            self._choose_limit()
        self._axis.prepare(experiment_limits(self.parameters.values))

    # lifecycle and services

    def activated(self) -> None:
        """Start the signal at the next sample that is not yet out."""
        self._sequence.restart()

    def deactivated(self) -> None:
        """Take back what was announced: everything from now on is neutral."""
        if self._now is None:
            return
        self._sequence.cut(self._now, 0.0)
        self._sequence.take_back(self._now)
        self._announce_again(self._now)

    def _announce_again(self, now: int) -> None:
        self._next = now + self._period_ns
        self._publish_ahead(now)

    def _start_signal(self) -> str:
        self.bring_up()
        if not self.active:
            raise InputError("not started")
        return "running"

    def _stop_signal(self) -> str:
        if self.active:
            self.trigger_deactivate()
        if self.active:
            raise InputError("not stopped")
        return "stopped: neutral values from the next sample on"

    def _begin_experiment(self) -> str:
        values = self.parameters
        if self._sequence.playing:
            raise InputError("an experiment is running already: call ~/stop_experiment first")
        if not values["experiment"]:
            raise InputError("no experiment: set the parameter experiment first")
        if not self.active or self._next is None:
            raise InputError("an experiment needs an active excitation and a running graph: call ~/start first")
        experiment = read_experiment(values["experiment"], self._target, values["sample_time"])
        experiment_limits(values.values).refuse(experiment)
        start, end = self._sequence.begin(experiment, values["handover_time"], values["rest_time"], self._next)
        self._experiments += 1
        self._breach = ""
        self._report_span()
        text = f"experiment from {start / SECOND:.3f} s to {end / SECOND:.3f} s"
        self.get_logger().info(text)
        return text

    def _stop_experiment(self) -> str:
        end = None if self._now is None else self._sequence.cut(self._now, self.parameters["handover_time"])
        if end is None or self._now is None:
            raise InputError("no experiment is running")
        self._announce_again(self._now)
        return "stopped: back to the normal signal from the next sample on"

    def _report_span(self) -> None:
        """Publish from when to when an experiment runs, again when a stop or a pause has moved that."""
        span = self._sequence.span
        if span is None or span == self._reported_span:
            return
        if self._reported_span is None or span[0] != self._reported_span[0]:
            self.tell_progress(span[0], EXPERIMENT)
        self.tell_progress(span[1], HANDED_BACK)
        self._reported_span = span

    def _guard(self) -> None:
        """Stop when the axis exceeds a limit during an experiment."""
        span = self._sequence.span if self.active else None
        breach = self._axis.breach(experiment_limits(self.parameters.values), span)
        if breach:
            self._breach = f"experiment stopped: {breach}"
            self.get_logger().error(self._breach)
            self.trigger_deactivate()

    # time

    def _on_clock(self, data: bytes) -> None:
        now = peek_stamp(data)
        # A clock that repeats its time after a while: the graph stands still because a node lacks what was published
        # then. A simulator that pauses repeats its clock at once.
        if now == self._now and time.monotonic() - self._published_at > QUIET:
            self._publish_again()
        self._follow(now)

    def _publish_again(self) -> None:
        self._published_at = time.monotonic()
        for message in self._recent:
            self._publish(message)

    def poll(self) -> None:
        """Real time: follow the system clock on whole periods of it."""
        super().poll()
        if not self._lockstep:
            self._follow(time.time_ns() // self._period_ns * self._period_ns)

    def _follow(self, now: int) -> None:
        if self.start.waiting:
            return  # no other node would receive what is published ahead now
        self._publish_ahead(now)
        self._guard()

    def _publish_ahead(self, now: int) -> None:
        if self._now is not None and now < self._now:
            self._next = None  # the clock was set back: a new run begins
            self._sequence.forget()
        self._now = now
        if self._next is None or self._next < now - self._ahead_ns:
            self._next = now
        for _ in range(BURST):
            if self._next > now + self._ahead_ns:
                break
            message = self._sample(self._next)
            self._publish(message)
            self._recent.append(message)
            self._published_at = time.monotonic()
            self._next += self._period_ns
            self._sent.count += 1
        self._report_span()

    def _sample(self, stamp: int) -> bytes:
        position, velocity = self._sequence.next(stamp, self.active)
        if self._reference:
            return self._writer.pack(stamp, (position,), (velocity,))
        return self._writer.pack(stamp, (position,))

    def health(self) -> list[Status]:
        """Return how far the signal is."""
        done, length = self._sequence.index, self._sequence.length
        values = {
            "signal": self.parameters["signal"],
            "samples": str(length),
            "sent_of_signal": str(done),
            "published": str(self._sent.count),
            "rate": f"{self._sent.rate():.1f}",
            "active": str(self.active).lower(),
            "experiments": str(self._experiments),
        }
        text = f"{self.parameters['signal']}: {100.0 * done / length:.0f} %"
        if self._sequence.playing:
            text = "experiment"
        text = text if self.active else "inactive"
        return [Status("signal", self._breach or text, Level.ERROR if self._breach else Level.OK, values)]


make = ExcitationNode
