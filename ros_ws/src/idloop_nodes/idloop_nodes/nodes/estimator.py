"""The estimator: predicts every sample, fits a sliding window in a worker process, diagnoses missing effects."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial

from rclpy.parameter import Parameter

from idloop.errors import InputError
from idloop.physics import Model, load_model
from idloop.records.bags.cdr import SECOND
from idloop_nodes.base import StreamNode
from idloop_nodes.codec import Status, encode_diagnostics
from idloop_nodes.codec.joints import output_columns, output_topic
from idloop_nodes.estimation.diagnosis_jobs import ADD_BEST, DESIGN, DIAGNOSE, SUGGEST, UNDO
from idloop_nodes.estimation.estimator import Estimator
from idloop_nodes.estimation.estimator_context import EstimatorContext
from idloop_nodes.estimation.job_queue import JobQueue
from idloop_nodes.graph_start import command_topic
from idloop_nodes.parameters import Values
from idloop_nodes.progress import DONE, due
from idloop_nodes.service_calls import ExperimentClient, ExperimentEnd
from idloop_nodes.streams.sample_buffer import SampleBuffer
from idloop_nodes.timing import Bursts
from idloop_nodes.topics import RESULTS

BURST, LOCKSTEP_BURST = 0.003, 0.04  # seconds between bursts of samples
# Parameters of the evidence: another value restarts the scores.
EVIDENCE_PARAMETERS = {"evidence_period", "end_when_decided", "level", "minimum_improvement", "catalogue"}
ORDERS = {
    "diagnose": DIAGNOSE,
    "add_best_effect": ADD_BEST,
    "undo": UNDO,
    "suggest_experiment": DESIGN,
    "run_suggested_experiment": SUGGEST,
}


class EstimatorNode(StreamNode):
    """Connects streams, parameters and services to `idloop_nodes.estimation.estimator.Estimator`."""

    def __init__(self) -> None:
        super().__init__("estimator")
        values, logger = self.parameters, self.get_logger()
        self._lockstep = values["mode"] == "lockstep"
        self.scheduling = "batch" if self._lockstep else "preferred"
        self._bursts = Bursts(LOCKSTEP_BURST) if self._lockstep else Bursts(BURST, values["sample_time"])
        model = self._load(values.values)
        commands, outputs = command_topic(model.input.topic, self.others), output_topic(model)
        self._streams = [self.poll_topic(topic) for topic in ("reference", commands, outputs)]
        self._always = [outputs, *([commands] if self._lockstep else [])]
        self._jobs = JobQueue(keep_all=self._lockstep)
        buffer = SampleBuffer(len(output_columns(model)))
        results = {topic: self.publisher(topic) for topic in RESULTS}

        def publish(name: str, stamp: int, statuses: Sequence[Status]) -> None:
            results[f"estimator/{name}"](encode_diagnostics(stamp, statuses))

        context = EstimatorContext(
            self.get_name(), logger.info, logger.warning, logger.error, values, buffer, self._jobs, publish
        )
        guards = [one for one in (values["bridge_node"], values["controller_node"]) if one]
        excitation = values["excitation_node"]
        client, end = ExperimentClient(self, excitation), ExperimentEnd(self, guards, excitation, logger.warning)
        self.estimator = Estimator(context, model, self.publisher, client, end, self._adopted)
        self._period_ns = context.period_ns
        self._reported: int | None = None
        self._done = False
        self._adopting = False
        values.check = self._check
        values.apply = self._apply
        self.offer("~/refit", self._refit)
        for service, verb in ORDERS.items():
            self.offer(f"~/{service}", partial(self._order, verb))

    # parameters

    @staticmethod
    def _load(values: Values) -> Model:
        return load_model(values["model"]).with_effects(values["effects"])

    def _check(self, values: Values) -> None:
        if output_columns(self._load(values)) != output_columns(self.estimator.model):
            raise InputError("the outputs of another model cannot be taken over by a running estimator")

    def _apply(self, names: set[str]) -> None:
        if not self._adopting and names & {"model", "effects"}:
            self.estimator.set_model(self._load(self.parameters.values), other_machine="model" in names)
            if self.estimator.input.last is not None:
                self.estimator.diagnosis.coordinator.set_effects(self.parameters["effects"])
        elif names & EVIDENCE_PARAMETERS:
            self.estimator.restart_evidence()

    def _adopted(self, model: Model) -> None:
        """Let the parameter `effects` follow a new step of the ladder."""
        own = load_model(self.parameters["model"]).effect_names
        effects = [name for name in model.effect_names if name not in own]
        self._adopting = True
        try:
            self.set_parameters([Parameter("effects", value=effects or [""])])
        finally:
            self._adopting = False

    def _switch_off_automatic(self) -> str:
        """Add and move nothing unasked any more, or the step would come back; return what was switched off."""
        names = [name for name in ("auto_add", "auto_experiment") if self.parameters[name]]
        if not names:
            return ""
        self.set_parameters([Parameter(name, value=False) for name in names])
        text = f"{' and '.join(names)} switched off, or the step would come back"
        self.get_logger().info(text)
        return f"; {text}"

    # samples

    def poll(self) -> None:
        """Take in what has arrived and process it in bursts; report how far this node has come."""
        super().poll()
        self.subscribe_silent_again(self._always)
        # An event such as the progress of another node must not cut the burst short.
        if self._bursts.due(time.monotonic()):
            samples = self.estimator.input
            before = samples.last
            samples.take(*self._streams)
            self.estimator.update(self.progress)
            self._report(samples.last)
            last, now = samples.last, time.monotonic()
            self._bursts.plan(now, None if last is None or last == before else (time.time_ns() - last) / SECOND)
            if not self._lockstep:
                self._bursts.weigh(now, time.process_time())
        self.poll_period = self._bursts.wait

    def _report(self, last: int | None) -> None:
        if last is None:
            return
        # While simulated time waits, all know exactly where: what follows begins on the same sample each time.
        if due(self._reported, last, self._period_ns) or (self.estimator.holding and last != self._reported):
            self._reported = last
            self.tell_progress(last)
        end = self.progress.end
        if end is not None and not self._done and last >= end and self.estimator.finish(last):
            self._done = True
            self.tell_progress(last, DONE)

    # services

    def _refit(self) -> str:
        return self.estimator.fits.fit_now(self.estimator.model, self.estimator.input.last)

    def _order(self, verb: str) -> str:
        message = self.estimator.diagnosis.coordinator.order(verb)
        return message + self._switch_off_automatic() if verb == UNDO else message

    def close(self) -> None:
        """End the worker."""
        self._jobs.close()

    def health(self) -> list[Status]:
        """Return rates, what waits, the newest fit, and what is under way."""
        return self.estimator.health()


make = EstimatorNode
