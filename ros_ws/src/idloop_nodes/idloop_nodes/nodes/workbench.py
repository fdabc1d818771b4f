"""The workbench: a browser page on the live graph; everything that it shows and computes is the library's."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from idloop.errors import InputError
from idloop.physics import load_model
from idloop.reporting.effect_names import words
from idloop.reporting.workbench.server import Place, Site
from idloop.reporting.workbench.source import OK, WARN, Activity, Note
from idloop_nodes.base import StreamNode
from idloop_nodes.codec import (
    CdrError,
    JointReader,
    Level,
    Status,
    decode_diagnostics,
    evidence_from_statuses,
    fit_from_statuses,
    ladder_from_statuses,
    missing_from_statuses,
    parameters_from_statuses,
)
from idloop_nodes.estimation.diagnosis_jobs import MotionLimits
from idloop_nodes.estimation.experiment_client import ExperimentClient
from idloop_nodes.health_names import node_seen_from, seen_from
from idloop_nodes.streams.joint_layout import output_columns, output_topic
from idloop_nodes.streams.rates import RateCounter
from idloop_nodes.tables import WORKBENCH
from idloop_nodes.wiring import told
from idloop_nodes.workbench_page.workbench_calls import Calls
from idloop_nodes.workbench_page.workbench_reading import (
    activity_of,
    automatic_of,
    evidence_of,
    fit_of,
    health_of,
    ladder_of,
    limits_of,
    missing_of,
)
from idloop_nodes.workbench_page.workbench_source import STOP, LiveSource
from idloop_nodes.workbench_page.workbench_stop import MotorStop

SILENT = 3.5  # seconds without a word after which a node counts as silent
LIMITS_PERIOD = 5.0  # seconds between two questions after the excitation's limits
ASKED = {
    "diagnose": "diagnose",
    "undo": "undo",
    "experiment": "run_suggested_experiment",
    "refit": "refit",
}
# Orders after which the estimator is at work until its next result.
BEGUN = {
    "diagnose": "looking for what is missing",
    "add": "adding {}",
    "undo": "taking the last step back",
    "experiment": "working out the next experiment",
}


class WorkbenchNode(StreamNode):
    """Fills the page's buffers from the streams, its board from the results, and passes orders on as service calls."""

    poll_period = 0.02

    def __init__(self) -> None:
        super().__init__("workbench", WORKBENCH)
        values = self.parameters
        model = load_model(values["model"])
        columns = output_columns(model)
        capacity = round(values["history"] / values["sample_time"])
        self.source = LiveSource(model, capacity, lambda: float(self.parameters["assess_window"]))
        self._base = model
        self._board, self._signals = self.source.board, self.source.signals
        outputs, command = JointReader(columns), JointReader([(model.input.joint, model.input.field)])
        # Each stream with its reader: measurement first, so that time begins with it.
        self._streams = [
            ("measured", self.poll_topic(output_topic(model)), outputs),
            ("command", self.poll_topic(told(model.input.topic, self.others)), command),
            ("reference", self.poll_topic("reference"), JointReader([("*", "position")])),
            ("predicted", self.poll_topic("estimator/prediction"), JointReader(columns)),
            ("residual", self.poll_topic("estimator/residual"), JointReader(columns)),
        ]
        self._samples = RateCounter()
        self._unreadable = 0
        self._asked = False  # an order is on its way to the estimator, which does not speak of it yet
        self._heard: dict[str, tuple[float, Status]] = {}
        self._health_due = self._limits_due = 0.0
        self._calls = Calls(self)
        estimator, excitation = values["estimator_node"], values["excitation_node"]
        here = self.get_namespace()
        guards = [node_seen_from(here, one) for one in (values["bridge_node"], values["controller_node"]) if one]
        self._estimator = node_seen_from(here, estimator)
        self._named = {self._estimator, *guards, node_seen_from(here, excitation)}
        self._motor = MotorStop(
            self._calls, self._board, guards, self._start_again, holds_position=model.input.field == "position"
        )
        self._calls.expect(
            *(f"{excitation}/{name}" for name in ("stop", "start")),
            *(f"{estimator}/{name}" for name in ("add_best_effect", *ASKED.values())),
        )
        self._excitation = ExperimentClient(self, values["excitation_node"])
        self._results: dict[str, Callable[[list[Status]], None]] = {
            "estimator/fit": self._take_fit,
            "estimator/parameters": self._take_parameters,
            "estimator/missing_effects": self._take_missing,
            "estimator/evidence": self._take_evidence,
            "estimator/ladder": self._take_ladder,
            "/diagnostics": self._take_health,
        }
        for topic, take in self._results.items():
            self.listen(topic, self._reader(take))
        self.site = Site(self.source, Place(values["address"], values["port"]))
        self.get_logger().info(f"the workbench is at {self.site.address}")

    # This node only looks on: the graph starts without waiting for it, and is not counted as ready by it.

    def announce_when_matched(self) -> bool:
        """Say nothing at the start barrier."""
        return True

    def _reader(self, take: Callable[[list[Status]], None]) -> Callable[[bytes], None]:
        def heard(data: bytes) -> None:
            try:
                take(decode_diagnostics(data)[1])
            except (CdrError, InputError, ValueError, KeyError) as error:
                self._unreadable += 1
                self.get_logger().warning(f"a result cannot be read: {error}")

        return heard

    def poll(self) -> None:
        """Take in what has arrived, pass orders on, begin computations."""
        while not self.source.requests.empty():
            self._carry_out(*self.source.requests.get())
        self._calls.poll()
        self._excitation.poll()
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
                    self._motor.see(value for (value,) in rows)
        self._motor.poll()
        self._look_around()
        self.source.work()

    def _look_around(self) -> None:
        now = time.monotonic()
        if now >= self._health_due:
            self._health_due = now + 0.5
            self._board.change(health=health_of([(one, now - then > SILENT) for then, one in self._heard.values()]))
            if self._board.snapshot.assessment is None:
                self.source.want("assess")
        if now >= self._limits_due and not self._excitation.busy:
            self._limits_due = now + LIMITS_PERIOD
            self._excitation.ask_limits(self._limits_known, lambda reason: None)

    def _limits_known(self, limits: MotionLimits) -> None:
        units = self._base.input.unit, self._base.units.position
        self._board.change(limits=limits_of(limits, *units))

    # orders

    def _carry_out(self, verb: str, what: str) -> None:
        values = self.parameters
        if verb == STOP:
            self._motor.stop()
            self._calls.trigger(f"{values['excitation_node']}/stop", lambda done, text: None)
            return
        if verb == "reset":
            self._motor.reset()
            return
        if verb in BEGUN:
            self._asked = True
            self._board.change(activity=Activity(BEGUN[verb].format(words(what))), note=None)
        estimator = values["estimator_node"]
        if verb == "add" and not self._is_best(what):
            self._calls.add_effect(estimator, what, self._answered)
            return
        if verb == "automatic":
            self._switch(*what.split())
            return
        service = "add_best_effect" if verb == "add" else ASKED[verb]
        self._calls.trigger(f"{estimator}/{service}", self._undone if verb == "undo" else self._answered)

    def _switch(self, what: str, to: str) -> None:
        """Switch on or off what the estimator does without being asked; its next health message says that it has."""
        estimator, name = self.parameters["estimator_node"], f"auto_{what}"
        self._calls.set_parameter(estimator, name, to == "on", f"{estimator}: {name} is {to}", self._answered)

    def _is_best(self, effect: str) -> bool:
        """Whether the estimator would add this effect of its own accord."""
        missing = self._board.snapshot.missing
        return missing is not None and bool(missing.set) and missing.candidates[0].name == effect

    def _answered(self, done: bool, text: str) -> None:
        self._asked = False  # from now on what was begun shows as the estimator's activity
        if not done:
            self._board.change(note=Note(text, WARN), activity=None)

    def _undone(self, done: bool, text: str) -> None:
        self._answered(done, text)
        if done and self._board.snapshot.automatic:
            said = "The graph adds nothing and moves nothing by itself any more, or the step would come back."
            self._board.change(automatic=(), note=Note(said, OK))

    def _start_again(self) -> None:
        self._calls.trigger(f"{self.parameters['excitation_node']}/start", lambda done, text: None)

    # results

    def _take_fit(self, statuses: list[Status]) -> None:
        fit = fit_of(fit_from_statuses(statuses))
        self._board.change(fit=fit)
        if not fit.error:
            self._go_on_with(fit.effects)

    def _take_parameters(self, statuses: list[Status]) -> None:
        found = {one.name: one.value for one in parameters_from_statuses(statuses)}
        known = {one.name for one in self.source.model.parameters}
        model = self.source.model.with_values({n: v for n, v in found.items() if n in known})
        # What is said anew of the same estimates, such as whether they may be trusted, is no reason to look again.
        if model.values != self.source.model.values or self._board.snapshot.assessment is None:
            self.source.model = model
            self.source.want("assess")

    def _go_on_with(self, effects: tuple[str, ...]) -> None:
        """Take the structure of the model that was fitted; its values come with its parameters."""
        if effects == tuple(self.source.model.effect_names):
            return
        own = self._base.effect_names
        self.source.model = self._base.with_effects([name for name in effects if name not in own])
        self._board.change(effects=effects)

    def _take_missing(self, statuses: list[Status]) -> None:
        self._board.change(
            missing=missing_of(missing_from_statuses(statuses), self._base.folder),
            looks=self._board.snapshot.looks + 1,
            pictures={},
            activity=None,
        )
        self.source.want("pictures")

    def _take_evidence(self, statuses: list[Status]) -> None:
        summary = evidence_from_statuses(statuses)
        self._board.change(evidence=evidence_of(summary, self._board.snapshot.evidence))

    def _take_ladder(self, statuses: list[Status]) -> None:
        summary = ladder_from_statuses(statuses)
        ladder = ladder_of(summary, self._base.folder)
        before = self._board.snapshot
        changes: dict[str, Any] = {"ladder": ladder, "suggested": summary.suggested_experiment}
        if summary.error:
            changes["note"] = Note(summary.error, WARN)
        if ladder is not None:
            effects = tuple(ladder.model.effect_names)
            if before.ladder is None or len(before.ladder.steps) != len(ladder.steps) or effects != before.effects:
                # What was missing from another model need not be missing from this one.
                if before.missing is not None and before.ladder is not None and effects != before.effects:
                    changes |= {"missing": None, "pictures": {}}
                self.source.model = ladder.model
                self.source.want("assess")
            changes |= {"effects": effects, "activity": None}
        self._board.change(**changes)

    def _take_health(self, statuses: list[Status]) -> None:
        now = time.monotonic()
        for one in statuses:
            node, check = seen_from(self.get_namespace(), one.name)
            if node.startswith("/") and node not in self._named:
                continue  # another axis
            self._heard[one.name] = now, replace(one, name=f"{node}: {check}" if check else node)
            if check == "diagnosis" and node == self._estimator:
                self._board.change(automatic=automatic_of(one))
                if not self._asked:
                    self._board.change(activity=activity_of(one))
            else:
                self._motor.hear(node, check, f"{one.message} {one.values.get('latched', '')}")

    # end and health

    def close(self) -> None:
        """End server and worker."""
        self.site.close()
        self.source.close()

    def health(self) -> list[Status]:
        """Return what the page takes in and who looks on."""
        rate = self._samples.rate()
        values = {
            "address": self.site.address if self.site.place.local else "",  # the token is nobody's business
            "browsers": str(self.site.sessions),
            "rate": f"{rate:.1f}",
            "buffers_mb": f"{self._signals.nbytes / 1e6:.1f}",
            "unreadable": str(self._unreadable),
        }
        level = Level.WARN if self._unreadable else Level.OK
        return [Status("page", f"{rate:.0f} samples/s, browsers: {self.site.sessions}", level, values)]


def make() -> WorkbenchNode:
    """Build the node."""
    return WorkbenchNode()
