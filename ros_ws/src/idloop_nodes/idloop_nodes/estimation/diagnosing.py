"""The estimator's side of diagnoses: data, orders, experiments and results, between the node and its desk."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from idloop.errors import InputError
from idloop_nodes.codec import Level, Status, encode_diagnostics, ladder_to_statuses, missing_to_statuses
from idloop_nodes.estimation.coordinator import Autopilot, Desk
from idloop_nodes.estimation.diagnosis_jobs import DIAGNOSE, DiagnosisAnswer, DiagnosisJob
from idloop_nodes.estimation.experiment_client import ExperimentClient
from idloop_nodes.estimation.fit_schedule import SHORTEST
from idloop_nodes.estimation.whiteness_watch import WhitenessWatch
from idloop_nodes.parameters import NodeParameters
from idloop_nodes.streams.sample_buffer import SECOND, DataBook, DiagnosisData

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop_nodes.codec import FitSummary
    from idloop_nodes.estimation.worker import Worker
    from idloop_nodes.progress import Progress

MOST_LINES = 4  # of where the model fails, in the log; the message has all of them

Publish = Callable[[bytes], None]


class Diagnosing:
    """Orders diagnoses about the newest data and publishes what comes of them.

    Parameters
    ----------
    node : rclpy.node.Node
        For its log, its name and its clients.
    parameters : NodeParameters
    book : DataBook
    worker : Worker
    numbers : callable
        Returns the number of the next job.
    publish_missing, publish_ladder : callable

    Attributes
    ----------
    last : int or None
        Stamp of the newest sample that was worked on [ns].
    model : Model
        The estimator's present model.
    """

    def __init__(
        self,
        node: Any,
        parameters: NodeParameters,
        book: DataBook,
        worker: Worker,
        numbers: Callable[[], int],
        model: Model,
        publish_missing: Publish,
        publish_ladder: Publish,
    ) -> None:
        self.model = model
        self.last: int | None = None
        self._name: str = node.get_name()
        self._logger = node.get_logger()
        self._parameters = parameters
        self._book = book
        self._worker = worker
        self._numbers = numbers
        self._publish_missing = publish_missing
        self._publish_ladder = publish_ladder
        self._period_ns = round(parameters["sample_time"] * SECOND)
        self._watch = WhitenessWatch()
        self._data = DiagnosisData()
        self._client = ExperimentClient(node, parameters["excitation_node"])
        self._said = ""
        self._postponed = ""  # why there will be a diagnosis after the order that is under way
        self._seen: tuple[int, int] | None = None
        self.desk = Desk(
            submit=self._submit,
            hand_over=self._hand_over,
            ask_limits=self._ask_limits,
            autopilot=self._autopilot,
            log=self._log,
        )

    def _log(self, text: str) -> None:
        self._logger.info(text)

    def _warn(self, text: str) -> None:
        self._logger.warning(text)

    def _autopilot(self) -> Autopilot:
        values = self._parameters
        return Autopilot(values["auto_diagnose"], values["auto_add"], values["auto_experiment"])

    # what happens

    def restart(self) -> None:
        """Forget everything: another model, or a new run of the clock."""
        self.desk.forget()
        self._data.clear()
        self._watch.arm()
        self.last = None

    def another_model(self, model: Model) -> None:
        """Go on with a model that the user or a step of the ladder has brought."""
        self.model = model
        self._watch.arm()

    @property
    def due(self) -> int | None:
        """Stamp after the last sample of a running experiment."""
        return None if self.desk.span is None else self.desk.span[1]

    @property
    def oldest(self) -> int | None:
        """Stamp from which on samples are still needed for a running experiment."""
        return None if self.desk.span is None else self.desk.span[0]

    def order(self, verb: str) -> str:
        """Give an order of the user; InputError when it cannot be given."""
        return self.desk.order(verb)

    def look(self, summary: FitSummary) -> None:
        """Take in the residual of a fit, and diagnose when it has stopped being white."""
        if summary.effects != tuple(self.model.effect_names) or not self._parameters["auto_diagnose"]:
            return
        if self.desk.span is not None:
            return  # a diagnosis follows the experiment in any case
        if self._watch.look(summary.whiteness, summary.fit):
            self._diagnose("the residual is not white")

    def look_at_evidence(self, reason: str) -> None:
        """Diagnose where the evidence has decided and no diagnosis of the present model is known."""
        if self._parameters["auto_diagnose"] and self.desk.missing is None and not self.desk.busy:
            self._diagnose(reason)

    def follow(self, progress: Progress) -> None:
        """Diagnose again when an experiment has brought new data."""
        self._client.poll()
        if self._postponed and not self.desk.busy:
            self._diagnose(self._postponed)
        if progress.experiment is None or progress.experiment[1] is None or self.last is None:
            return
        span = progress.experiment[0], progress.experiment[1]
        if span != self._seen:
            self._seen = span
            self.desk.span = span if span[1] > span[0] else None
        running = self.desk.span
        ending = progress.end is not None and self.last >= progress.end
        if running is None or not (ending or self.last + self._period_ns + self._period_ns // 2 >= running[1]):
            return
        self.desk.span = None
        stop = min(running[1], self.last + self._period_ns)
        if self._data.add_experiment(self._book, self.model, (running[0], stop), self._share, SHORTEST):
            self._watch.arm()
            self._diagnose("the experiment is over")
        else:
            self._warn("the experiment was too short to learn from")

    def _diagnose(self, reason: str) -> None:
        self._postponed = reason if self.desk.busy else ""
        if self._postponed:
            return
        try:
            text = self.desk.order(DIAGNOSE)
        except InputError as error:
            self._warn(f"{reason}, but there is no diagnosis: {error}")
            return
        self._log(f"{reason}: {text}")

    # orders to the worker and the excitation

    @property
    def _share(self) -> float:
        values = self._parameters
        return float(values["validation"] / (values["diagnose_window"] + values["validation"]))

    def _submit(self, verb: str, notebook: bytes, **more: Any) -> str:
        values, data = self._parameters, self._data
        if self.last is None:
            raise InputError("no samples yet")
        end = self.last + self._period_ns
        if verb == DIAGNOSE or not data.records:
            length = round((values["diagnose_window"] + values["validation"]) * SECOND)
            data.renew(self._book, self.model, end, length, self._share, SHORTEST)
        if not data.records:
            raise InputError("too few samples yet")
        self._worker.submit(
            DiagnosisJob(
                self._numbers(),
                verb,
                self.last,
                self.model,
                notebook,
                data.records,
                data.validation,
                data.spans,
                catalogue=values["catalogue"],
                level=values["level"],
                criterion=values["criterion"],
                minimum_improvement=values["minimum_improvement"],
                seed=values["seed"],
                experiments=data.experiments,
                **more,
            )
        )
        seconds = " + ".join(f"{(stop - start) / SECOND:.1f} s" for start, stop in data.spans)
        return f"{verb} on {seconds} of data; the result comes on estimator/missing_effects and estimator/ladder"

    def _hand_over(self, experiment: str) -> None:
        self._client.run(experiment, self.desk.handed_over, self._refused)

    def _ask_limits(self) -> None:
        self._client.ask_limits(self.desk.limits_known, self._refused)

    def _refused(self, reason: str) -> None:
        self.desk.refused(reason)
        if self.desk.ladder is not None and self.last is not None:
            statuses = ladder_to_statuses(self._name, self.desk.ladder)
            self._publish_ladder(encode_diagnostics(self.last, statuses))

    # results

    def take(self, answer: DiagnosisAnswer, adopt: Callable[[Model], None]) -> None:
        """Publish an answer of the worker, go on with its model, order what follows."""
        taken = self.desk.take(answer)
        if taken is None:
            return
        if taken.missing is not None:
            statuses = missing_to_statuses(self._name, taken.missing)
            self._publish_missing(encode_diagnostics(taken.stamp, statuses))
            for line in taken.missing.where[:MOST_LINES]:
                self._log(f"where: {line.strip()}")
            self._log(f"diagnosis: {statuses[0].message}")
        if taken.model is not None:
            adopt(taken.model)
        if taken.ladder is not None:
            statuses = ladder_to_statuses(self._name, taken.ladder)
            self._publish_ladder(encode_diagnostics(taken.stamp, statuses))
            if statuses[0].message != self._said:
                self._said = statuses[0].message
                self._log(f"ladder: {self._said}")
        self.desk.go_on(taken)

    def health(self) -> Status:
        """Return what is being worked out, or the newest result."""
        desk, note = self.desk, self._worker.note
        values = {
            "order": desk.ordered or desk.waiting,
            "experiment": "" if desk.span is None else "running",
            "experiments": str(self._data.experiments),
            "armed": str(self._watch.armed).lower(),
            "automatic": str(self._autopilot()),
        }
        if desk.busy:
            share = "" if note is None or not desk.ordered else f" {100.0 * note.share:.0f} %, {note.text}"
            return Status("diagnosis", f"{desk.ordered or desk.waiting}{share}", Level.OK, values)
        if desk.missing is None:
            return Status("diagnosis", "none yet", Level.OK, values)
        head = missing_to_statuses("", desk.missing)[0]
        return Status("diagnosis", head.message, head.level, values)
