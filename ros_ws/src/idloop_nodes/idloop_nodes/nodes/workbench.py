"""The workbench: a browser page on the live graph; the library draws and computes everything on it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from idloop.errors import InputError
from idloop.physics import load_model
from idloop.reporting.workbench.server import Place, Site
from idloop_nodes.base import StreamNode
from idloop_nodes.codec import CdrError, JointReader, Level, Status, decode_diagnostics
from idloop_nodes.codec.diagnostics import node_seen_from, seen_from
from idloop_nodes.codec.joints import output_columns, output_topic
from idloop_nodes.estimation.diagnosis_jobs import MotionLimits
from idloop_nodes.graph_start import command_topic
from idloop_nodes.service_calls import ExperimentClient, ServiceCalls
from idloop_nodes.streams.rates import RateCounter
from idloop_nodes.workbench_page.orders import PageOrders
from idloop_nodes.workbench_page.reading import PageResults, activity_of, automatic_of, health_of, limits_of
from idloop_nodes.workbench_page.source import LiveSource

SILENT = 3.5  # seconds without a health message after which a node counts as silent
HEALTH_PERIOD, LIMITS_PERIOD = 0.5, 5.0  # seconds between two updates of health and of the excitation's limits


class WorkbenchNode(StreamNode):
    """Fills the page from streams and results; its orders become service calls; no part of the start barrier."""

    poll_period = 0.02

    def __init__(self) -> None:
        super().__init__("workbench")
        values = self.parameters
        model = load_model(values["model"])
        columns = output_columns(model)
        capacity = round(values["history"] / values["sample_time"])
        self.source = LiveSource(model, capacity, lambda: float(self.parameters["assess_window"]))
        self._model = model
        self._page, self._signals = self.source.state, self.source.signals
        outputs, command = JointReader(columns), JointReader([(model.input.joint, model.input.field)])
        # Each stream with its reader: measurement first, so that time begins with it.
        self._streams = [
            ("measured", self.poll_topic(output_topic(model)), outputs),
            ("command", self.poll_topic(command_topic(model.input.topic, self.others)), command),
            ("reference", self.poll_topic("reference"), JointReader([("*", "position")])),
            ("predicted", self.poll_topic("estimator/prediction"), JointReader(columns)),
            ("residual", self.poll_topic("estimator/residual"), JointReader(columns)),
        ]
        self._samples = RateCounter()
        self._unreadable = 0
        self._checks: dict[str, tuple[float, Status]] = {}  # newest health by name, and when it arrived
        self._health_due = self._limits_due = 0.0
        self._calls = ServiceCalls(self)
        estimator, excitation = values["estimator_node"], values["excitation_node"]
        here = self.get_namespace()
        guards = [node_seen_from(here, one) for one in (values["bridge_node"], values["controller_node"]) if one]
        self._estimator = node_seen_from(here, estimator)
        self._named = {self._estimator, *guards, node_seen_from(here, excitation)}
        holds_position = model.input.field == "position"
        self._orders = PageOrders(self._calls, self._page, estimator, excitation, guards, holds_position=holds_position)
        self._excitation = ExperimentClient(self, excitation)
        for topic, take in PageResults(self.source, model).takers.items():
            self.listen(topic, self._reader(take))
        self.listen("/diagnostics", self._reader(self._take_health))
        self.site = Site(self.source, Place(values["address"], values["port"]))
        self.get_logger().info(f"the workbench is at {self.site.address}")

    def _reader(self, take: Callable[[list[Status]], None]) -> Callable[[bytes], None]:
        def read(data: bytes) -> None:
            try:
                take(decode_diagnostics(data)[1])
            except (CdrError, InputError, ValueError, KeyError) as error:
                self._unreadable += 1
                self.get_logger().warning(f"a result cannot be read: {error}")

        return read

    def poll(self) -> None:
        """Take in what has arrived, carry out orders, begin computations."""
        while not self.source.requests.empty():
            self._orders.carry_out(*self.source.requests.get())
        self._calls.poll()
        self._excitation.calls.poll()
        for name, stream, reader in self._streams:
            stamps: list[int] = []
            rows: list[tuple[float, ...]] = []
            for data, _ in stream.take():
                try:
                    stamp, row = reader.read(data)
                except CdrError:
                    self._unreadable += 1
                    continue
                stamps.append(stamp)
                rows.append(row)
            if stamps:
                self._signals.extend(name, stamps, rows)
                if name == "measured":
                    self._samples.count += len(stamps)
                elif name == "command":
                    self._orders.motor.see(value for (value,) in rows)
        self._orders.motor.poll()
        self._update_health()
        self.source.work()

    def _update_health(self) -> None:
        now = time.monotonic()
        if now >= self._health_due:
            self._health_due = now + HEALTH_PERIOD
            self._page.change(health=health_of([(one, now - then > SILENT) for then, one in self._checks.values()]))
            if self._page.snapshot.assessment is None:
                self.source.want("assess")
        if now >= self._limits_due and not self._excitation.calls.busy:
            self._limits_due = now + LIMITS_PERIOD
            self._excitation.ask_limits(self._limits_known, lambda reason: None)

    def _limits_known(self, limits: MotionLimits) -> None:
        self._page.change(limits=limits_of(limits, self._model.input.unit, self._model.units.position))

    def _take_health(self, statuses: list[Status]) -> None:
        now = time.monotonic()
        for one in statuses:
            node, check = seen_from(self.get_namespace(), one.name)
            if node.startswith("/") and node not in self._named:
                continue  # another axis
            self._checks[one.name] = now, replace(one, name=f"{node}: {check}" if check else node)
            if check == "diagnosis" and node == self._estimator:
                self._page.change(automatic=automatic_of(one))
                if not self._orders.pending:
                    self._page.change(activity=activity_of(one))
            else:
                self._orders.motor.update(node, check, f"{one.message} {one.values.get('latched', '')}")

    def close(self) -> None:
        """End server and worker."""
        self.site.close()
        self.source.close()

    def health(self) -> list[Status]:
        """Return what the page takes in, and how many browsers show it."""
        rate = self._samples.rate()
        values = {
            "address": self.site.address if self.site.place.local else "",  # the token stays secret
            "browsers": str(self.site.sessions),
            "rate": f"{rate:.1f}",
            "buffers_mb": f"{self._signals.nbytes / 1e6:.1f}",
            "unreadable": str(self._unreadable),
        }
        level = Level.WARN if self._unreadable else Level.OK
        return [Status("page", f"{rate:.0f} samples/s, browsers: {self.site.sessions}", level, values)]


make = WorkbenchNode
