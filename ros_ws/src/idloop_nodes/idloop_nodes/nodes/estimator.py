"""The estimator: predicts every sample, fits a sliding window in a worker, finds out what is missing."""

from __future__ import annotations

import itertools
import time
from typing import Any

from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from idloop.errors import InputError
from idloop.physics import Model, load_model
from idloop_nodes.base import StreamNode
from idloop_nodes.codec import (
    CdrError,
    FitSummary,
    JointReader,
    Level,
    Status,
    encode_diagnostics,
    fit_to_statuses,
)
from idloop_nodes.estimation.diagnosing import Diagnosing
from idloop_nodes.estimation.diagnosis_jobs import ADD_BEST, DIAGNOSE, SUGGEST, UNDO, DiagnosisAnswer
from idloop_nodes.estimation.evidence_jobs import EvidenceAnswer
from idloop_nodes.estimation.evidence_looks import EvidenceLooks
from idloop_nodes.estimation.experiment_end import ExperimentEnd
from idloop_nodes.estimation.fit_jobs import FitAnswer
from idloop_nodes.estimation.fit_schedule import FitSchedule
from idloop_nodes.estimation.monitor_jobs import MonitorAnswer
from idloop_nodes.estimation.monitoring import Monitoring
from idloop_nodes.estimation.prediction import Prediction, Sample
from idloop_nodes.estimation.recursive_model import RecursiveModel
from idloop_nodes.estimation.worker import Worker
from idloop_nodes.parameters import Values
from idloop_nodes.progress import DONE, due
from idloop_nodes.streams.bursts import Bursts
from idloop_nodes.streams.command_wait import CommandWait
from idloop_nodes.streams.held_stream import HeldStream
from idloop_nodes.streams.joint_layout import OutputPacker, output_columns, output_topic
from idloop_nodes.streams.rates import RateCounter
from idloop_nodes.streams.sample_buffer import SECOND, DataBook
from idloop_nodes.tables import ESTIMATOR
from idloop_nodes.wiring import told
from idloop_nodes.workbench_page.workbench_calls import Calls

BLOCK = 500  # samples worked off in one go, so that services stay answered
BURST, PATIENT_BURST = 0.003, 0.04  # seconds; in lock-step nobody is in a hurry
FORGET_PERIOD = SECOND // 2  # between two looks at what is too old to be kept [ns]
# Parameters with which the evidence is weighed: another value begins anew.
WEIGHED_BY = {"evidence_period", "end_when_decided", "level", "minimum_improvement", "catalogue"}
ORDERS = {"diagnose": DIAGNOSE, "add_best_effect": ADD_BEST, "undo": UNDO, "run_suggested_experiment": SUGGEST}


class EstimatorNode(StreamNode):
    """Pairs measurements with the commands that hold at their stamps and hands both to the library."""

    def __init__(self) -> None:
        super().__init__("estimator", ESTIMATOR)
        values = self.parameters
        self._lockstep = values["mode"] == "lockstep"
        self.patient, self.preferred = self._lockstep, not self._lockstep
        self._bursts = Bursts(PATIENT_BURST) if self._lockstep else Bursts(BURST, values["sample_time"])
        self._period_ns = round(values["sample_time"] * SECOND)
        self._model = self._load(values.values)
        columns = output_columns(self._model)
        self._command_reader = JointReader([(self._model.input.joint, self._model.input.field)])
        self._output_reader = JointReader(columns)
        self._reference_reader = JointReader([("*", "position"), ("*", "velocity")])
        self._held = HeldStream()
        self._command_wait = CommandWait(self._period_ns, self._lockstep, time.monotonic())
        self._pending: list[Sample] = []
        self._book = DataBook(len(columns))
        command_topic = told(self._model.input.topic, self.others)
        self._command_stream = self.poll_topic(command_topic)
        self._output_stream = self.poll_topic(output_topic(self._model))
        self._reference_stream = self.poll_topic("reference")
        self._always = [output_topic(self._model), *([command_topic] if self._lockstep else [])]
        self._prediction = Prediction(
            wanted=values["recursive"],
            sample_time=values["sample_time"],
            packer=OutputPacker(columns),
            publish_prediction=self.publisher("estimator/prediction"),
            publish_residual=self.publisher("estimator/residual"),
        )
        self._recursion = RecursiveModel(
            self.get_name(),
            values.values,
            self._model,
            OutputPacker(columns),
            self.publisher("estimator/innovation"),
            self.publisher("estimator/coefficients"),
        )
        self._publish_fit = self.publisher("estimator/fit")
        self._worker = Worker(queue_all=self._lockstep)
        self._jobs = itertools.count(1)
        self._submitted = 0
        self._fits = FitSchedule(values, self._book, self._worker, self._number)
        self._diagnosing = Diagnosing(
            self,
            values,
            self._book,
            self._worker,
            self._number,
            self._model,
            self.publisher("estimator/missing_effects"),
            self.publisher("estimator/ladder"),
        )
        guards = [one for one in (values["bridge_node"], values["controller_node"]) if one]
        warn = self.get_logger().warning
        self._evidence = EvidenceLooks(
            self.get_name(),
            lambda text: self.get_logger().info(text),
            values,
            self._book,
            self._worker,
            self._number,
            self._model,
            lambda: self._diagnosing.desk.missing,
            self._diagnosing.look_at_evidence,
            ExperimentEnd(Calls(self), guards, values["excitation_node"], warn),
            self.publisher("estimator/evidence"),
            self.publisher("estimator/parameters"),
        )
        self._monitoring = Monitoring(
            self.get_name(),
            lambda text: self.get_logger().info(text),
            lambda text: self.get_logger().warning(text),
            values,
            self._book,
            self._worker,
            self._number,
            self._model,
            self.publisher("estimator/wear"),
        )
        self._last: int | None = None
        self._forgot = 0
        self._told: int | None = None
        self._warned = 0
        self._done = False
        self._samples = RateCounter()
        self._unreadable = 0
        self._resets = 0
        self._newest_fit: FitSummary | None = None
        self._adopting = False
        values.check = self._check
        values.apply = self._apply
        self._prediction.warm_up(self._model)
        self.create_service(Trigger, "~/refit", self._on_refit)
        for name, verb in ORDERS.items():
            self.create_service(Trigger, f"~/{name}", self._order_service(verb))

    def _number(self) -> int:
        self._submitted = next(self._jobs)
        return self._submitted

    # parameters

    @staticmethod
    def _load(values: Values) -> Model:
        return load_model(values["model"]).with_effects(values["effects"])

    def _check(self, values: Values) -> None:
        model = self._load(values)
        if output_columns(model) != output_columns(self._model):
            raise InputError("the outputs of another model cannot be taken over by a running estimator")

    def _apply(self, names: set[str]) -> None:
        if self._adopting or not names & {"model", "effects"}:
            if names & WEIGHED_BY:
                self._evidence.begin(self._model)
            return
        self._model = self._load(self.parameters.values)
        self._prediction.begin(self._model)
        if "model" in names:
            self._diagnosing.restart()
            self._diagnosing.last = self._last
            self._monitoring.begin(self._model)
        self._diagnosing.another_model(self._model)
        self._evidence.begin(self._model)
        self._fits.fit_now(self._model, self._last)
        if self._last is not None:
            self._diagnosing.desk.set_effects(self.parameters["effects"])

    def _adopt(self, model: Model) -> None:
        """Go on with the model of a new step; the parameter `effects` says which that is."""
        self._model = model
        self._prediction.go_on(model)
        self._diagnosing.another_model(model)
        self._evidence.begin(model)
        own = load_model(self.parameters["model"]).effect_names
        effects = [name for name in model.effect_names if name not in own]
        self._adopting = True
        try:
            self.set_parameters([Parameter("effects", value=effects or [""])])
        finally:
            self._adopting = False

    def _leave_the_lead(self) -> str:
        """Add and move nothing unasked any more: what the user has taken away would come back.

        Returns
        -------
        str
            What was switched off, for the user; empty when nothing was on.
        """
        names = [name for name in ("auto_add", "auto_experiment") if self.parameters[name]]
        if not names:
            return ""
        self.set_parameters([Parameter(name, value=False) for name in names])
        said = f"; {' and '.join(names)} switched off, or the step would come back"
        self.get_logger().info(said.removeprefix("; "))
        return said

    # samples

    def poll(self) -> None:
        """Take in what has arrived, predict, fit what is due, publish what the worker has finished."""
        super().poll()
        self.subscribe_again_if_deaf(self._always)
        # An event such as somebody's progress must not cut the burst short.
        if self._bursts.due(time.monotonic()):
            before = self._last
            self._burst()
            age = None if self._last in (None, before) else (time.time_ns() - self._last) / SECOND
            now = time.monotonic()
            self._bursts.plan(now, age)
            if not self._lockstep:
                self._bursts.weigh(now, time.process_time())
        self.poll_period = self._bursts.wait

    def _burst(self) -> None:
        for stream, take in (
            (self._reference_stream, self._take_reference),
            (self._command_stream, self._take_command),
            (self._output_stream, self._take_output),
        ):
            for data, _ in stream.take():
                try:
                    take(data)
                except CdrError:
                    self._unreadable += 1
        for answer in self._worker.answers():
            self._take_answer(answer)
        self._diagnosing.follow(self.progress)
        self._evidence.poll()
        self._predict()
        self._report()

    def _take_reference(self, data: bytes) -> None:
        self._book.announce(*self._reference_reader.read(data))

    def _take_command(self, data: bytes) -> None:
        stamp, row = self._command_reader.read(data)
        self._command_wait.heard(time.monotonic())
        self._held.push(stamp, row)
        self._book.commands.append(stamp, row)

    def _take_output(self, data: bytes) -> None:
        stamp, row = self._output_reader.read(data)
        newest = self._pending[-1][0] if self._pending else self._last
        if newest is not None and stamp <= newest:
            if newest - stamp > SECOND:
                self._restart()
            else:
                return
        self._pending.append((stamp, row))
        self._book.outputs.append(stamp, row)

    def _restart(self) -> None:
        """Forget everything: the clock was set back, a new run begins."""
        self._resets += 1
        self._pending.clear()
        self._held.clear()
        self._book.clear()
        self._fits.restart()
        self._diagnosing.restart()
        self._evidence.restart()
        self._monitoring.restart()
        self._last = None
        self._prediction.begin(self._model)
        self._recursion.begin()

    @property
    def _holding(self) -> bool:
        """Lock-step: whether simulated time waits for a result, so that equal runs give equal results."""
        values = self.parameters
        deciding = (values["auto_diagnose"] or values["end_when_decided"]) and self._worker.busy
        return self._lockstep and (deciding or self._diagnosing.desk.busy or self._evidence.ending)

    def _predict(self) -> None:
        while self._pending and not self._holding:
            count = self._certain(self._pending[:BLOCK])
            if not count:
                return
            block, self._pending = self._pending[:count], self._pending[count:]
            self._process(block)

    def _certain(self, block: list[Sample]) -> int:
        """Return how many samples from the start have their command, or have waited long enough for it.

        A sample that completes a window or an experiment is the last of its block.
        """
        newest = self._pending[-1][0]
        limit = self._command_wait.known_until(self._held.newest, newest, self.progress.end, time.monotonic())
        count = sum(stamp <= limit for stamp, _ in block)
        for last in (self._fits.due, self._diagnosing.due, self._evidence.due):
            if last is not None:
                count = min(count, 1 + sum(stamp < last - self._period_ns * 3 // 2 for stamp, _ in block))
        return count

    def _process(self, block: list[Sample]) -> None:
        if self._book.first is None:
            self._book.first = block[0][0]
        self._last = self._diagnosing.last = block[-1][0]
        self._samples.count += len(block)
        commands = [self._held.at(stamp) for stamp, _ in block]
        for follower in (self._prediction, self._recursion):
            healthy = not follower.failure
            follower.take(self._book.first, block, commands)
            if healthy and follower.failure:
                self.get_logger().error(follower.failure)
        self._fits.follow(self._model, self._last)
        self._evidence.follow(self._last)
        self._monitoring.follow(self._last)
        self._diagnosing.follow(self.progress)
        for one in self._book.computed[self._warned :]:
            self.get_logger().warning(one.text)
        self._warned = len(self._book.computed)
        self._forget(self._last)

    def _forget(self, last: int) -> None:
        if 0 <= last - self._forgot < FORGET_PERIOD:
            return
        self._forgot = last
        window, validation = self._fits.spans
        longest = max(window, round(self.parameters["diagnose_window"] * SECOND)) + validation
        oldest = last - max(longest, round(self.parameters["fit_period"] * SECOND)) - 2 * SECOND
        needed = [
            one for one in (self._diagnosing.oldest, self._evidence.oldest, self._monitoring.oldest) if one is not None
        ]
        self._book.forget(min([oldest, *needed]))

    # services and results

    def _on_refit(self, request: Any, response: Any) -> Any:
        response.message = self._fits.fit_now(self._model, self._last)
        response.success = response.message.startswith("fit")
        return response

    def _order_service(self, verb: str) -> Any:
        def answer(request: Any, response: Any) -> Any:
            try:
                response.message, response.success = self._diagnosing.order(verb), True
                if verb == UNDO:
                    response.message += self._leave_the_lead()
            except InputError as error:
                response.message, response.success = str(error), False
            return response

        return answer

    def _take_answer(self, answer: FitAnswer | DiagnosisAnswer | EvidenceAnswer | MonitorAnswer) -> None:
        if isinstance(answer, MonitorAnswer):
            self._monitoring.take(answer)
            return
        if isinstance(answer, EvidenceAnswer):
            self._evidence.take(answer)
            return
        if isinstance(answer, DiagnosisAnswer):
            self._diagnosing.take(answer, self._adopt)
            return
        name, stamp = self.get_name(), answer.summary.validation_window[1] - self._period_ns
        self._newest_fit = answer.summary
        statuses = fit_to_statuses(name, answer.summary)
        self._publish_fit(encode_diagnostics(stamp, statuses))
        if not answer.parameters:
            self.get_logger().warning(f"no fit: {answer.summary.error}")
            return
        self._evidence.take_fit(answer.summary, answer.parameters, stamp)
        self.get_logger().info(
            f"{statuses[0].message}: " + ", ".join(f"{one.name} = {one.line}" for one in answer.parameters)
        )
        self._diagnosing.look(answer.summary)

    # progress and health

    def _report(self) -> None:
        last = self._last
        if last is None:
            return
        # While simulated time waits, everybody knows exactly where: what follows begins on the same sample each time.
        if due(self._told, last, self._period_ns) or (self._holding and last != self._told):
            self._told = last
            self.tell_progress(last)
        end = self.progress.end
        if end is None or self._done or last < end:
            return
        if not self._monitoring.busy:
            self._monitoring.finish(last)
        working = (self._diagnosing.desk, self._evidence, self._monitoring, self._worker)
        if not any(one.busy for one in working):
            self._done = True
            self._recursion.tell(last)
            self.tell_progress(last, DONE)

    def close(self) -> None:
        """End the worker."""
        self._worker.close()

    def health(self) -> list[Status]:
        """Return rates, what waits, the newest fit, and what is being worked out."""
        rate = self._samples.rate()
        values = {
            "samples": str(self._samples.count),
            "rate": f"{rate:.1f}",
            "waiting": str(len(self._pending)),
            "unreadable": str(self._unreadable),
            "restarts": str(self._resets),
        }
        fits = {
            "submitted": str(self._submitted),
            "skipped": str(self._worker.skipped),
            "worker_failures": str(self._worker.failures),
        }
        fit = self._newest_fit
        text = "no fit yet" if fit is None else fit_to_statuses("", fit)[0].message
        level = Level.WARN if self._worker.failures or (fit is not None and fit.error) else Level.OK
        failure = self._prediction.failure
        return [
            Status("prediction", failure or f"{rate:.0f} samples/s", Level.ERROR if failure else Level.OK, values),
            Status("fits", text, level, fits),
            *self._recursion.health(),
            *self._monitoring.health(),
            *self._evidence.health(),
            self._diagnosing.health(),
        ]


def make() -> EstimatorNode:
    """Build the node."""
    return EstimatorNode()
