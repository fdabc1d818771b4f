"""When missing effects are diagnosed, on which data, and what is published of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from idloop.errors import InputError
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import LadderSummary, Level, Status
from idloop_nodes.estimation.coordinator import Autopilot, Coordinator
from idloop_nodes.estimation.diagnosis_jobs import DIAGNOSE, DiagnosisAnswer, DiagnosisOrder
from idloop_nodes.estimation.estimator_context import SHORTEST, EstimatorContext
from idloop_nodes.estimation.whiteness_watch import WhitenessWatch
from idloop_nodes.service_calls import ExperimentClient
from idloop_nodes.streams.sample_buffer import DiagnosisData

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop_nodes.codec import FitSummary
    from idloop_nodes.progress import Progress

MAXIMUM_LINES = 4  # of where the model fails, in the log; the message has all of them


class DiagnosisSchedule:
    """Orders diagnoses of the newest data and publishes their results; `adopt` takes the model of a new step."""

    def __init__(
        self, context: EstimatorContext, client: ExperimentClient, model: Model, adopt: Callable[[Model], None]
    ) -> None:
        self.model = model
        self.last: int | None = None
        self._context = context
        self._client = client
        self._adopt = adopt
        self._whiteness = WhitenessWatch()
        self._data = DiagnosisData()
        self._logged = ""  # newest line on the ladder
        self._postponed = ""  # reason for a diagnosis after the order that is under way
        self._seen: tuple[int, int] | None = None
        self.coordinator = Coordinator(
            submit=self._submit,
            hand_over=lambda experiment: client.run(experiment, self.coordinator.handed_over, self._refused),
            ask_limits=lambda: client.ask_limits(self.coordinator.limits_known, self._refused),
            autopilot=self._autopilot,
            log=context.info,
        )

    def _autopilot(self) -> Autopilot:
        return Autopilot(*(self._context.parameters[f"auto_{name}"] for name in ("diagnose", "add", "experiment")))

    def restart(self) -> None:
        """Forget everything: another model, or a new run of the clock."""
        self.coordinator.forget()
        self._data.clear()
        self._whiteness.arm()
        self.last = None

    def another_model(self, model: Model) -> None:
        """Continue with a model of the user or of a step of the ladder."""
        self.model = model
        self._whiteness.arm()

    @property
    def due(self) -> int | None:
        """Stamp after the last sample of a running experiment."""
        return None if self.coordinator.span is None else self.coordinator.span[1]

    @property
    def oldest(self) -> int | None:
        """Stamp from which on samples are still needed for a running experiment."""
        return None if self.coordinator.span is None else self.coordinator.span[0]

    def take_fit(self, summary: FitSummary) -> None:
        """Diagnose when the residuals of the fits are not white any more."""
        if summary.effects != tuple(self.model.effect_names) or not self._autopilot().diagnose:
            return
        # After an experiment a diagnosis follows in any case.
        if self.coordinator.span is None and self._whiteness.look(summary.whiteness, summary.fit):
            self._diagnose("the residual is not white")

    def take_evidence(self, reason: str) -> None:
        """Diagnose when the evidence has decided and there is no diagnosis of the present model."""
        if self.coordinator.missing is None and not self.coordinator.busy and self._autopilot().diagnose:
            self._diagnose(reason)

    def follow(self, progress: Progress) -> None:
        """Diagnose again when an experiment has brought new data."""
        self._client.calls.poll()
        if self._postponed and not self.coordinator.busy:
            self._diagnose(self._postponed)
        if progress.experiment is None or progress.experiment[1] is None or self.last is None:
            return
        span = progress.experiment[0], progress.experiment[1]
        if span != self._seen:
            self._seen = span
            self.coordinator.span = span if span[1] > span[0] else None
        running = self.coordinator.span
        ending = progress.end is not None and self.last >= progress.end
        step = self._context.period_ns
        if running is None or not (ending or self.last + step + step // 2 >= running[1]):
            return
        self.coordinator.span = None
        stop = min(running[1], self.last + step)
        if self._data.add_experiment(self._context.buffer, self.model, (running[0], stop), self._share, SHORTEST):
            self._whiteness.arm()
            self._diagnose("the experiment is over")
        else:
            self._context.warn("the experiment was too short for a diagnosis")

    def _diagnose(self, reason: str) -> None:
        self._postponed = reason if self.coordinator.busy else ""
        if self._postponed:
            return
        try:
            text = self.coordinator.order(DIAGNOSE)
        except InputError as error:
            self._context.warn(f"{reason}, but there is no diagnosis: {error}")
            return
        self._context.info(f"{reason}: {text}")

    # orders to the worker

    @property
    def _share(self) -> float:
        values = self._context.parameters
        return float(values["validation"] / (values["diagnose_window"] + values["validation"]))

    def _submit(self, verb: str, state: bytes, **more: Any) -> str:
        values, data = self._context.parameters, self._data
        if self.last is None:
            raise InputError("no samples yet")
        if verb == DIAGNOSE or not data.records:
            length = round((values["diagnose_window"] + values["validation"]) * SECOND)
            end = self.last + self._context.period_ns
            data.renew(self._context.buffer, self.model, end, length, self._share, SHORTEST)
        if not data.records:
            raise InputError("too few samples yet")
        names = ("catalogue", "level", "criterion", "minimum_improvement", "seed")
        order = DiagnosisOrder(
            self._context.name,
            verb,
            self.last,
            self.model,
            state,
            data.records,
            data.validation,
            data.spans,
            experiments=data.experiments,
            **{name: values[name] for name in names},
            **more,
        )
        self._context.jobs.submit(order.carry_out, self._take, lambda reason: self._take(order.failed(reason)))
        seconds = " + ".join(f"{(stop - start) / SECOND:.1f} s" for start, stop in data.spans)
        return f"{verb} on {seconds} of data; the result comes on estimator/missing_effects and estimator/ladder"

    def _refused(self, reason: str) -> None:
        self.coordinator.refused(reason)
        if self.coordinator.ladder is not None and self.last is not None:
            self._publish_ladder(self.last, self.coordinator.ladder)

    # results

    def _take(self, answer: DiagnosisAnswer) -> None:
        """Publish an answer of the worker, continue with its model, order what follows."""
        taken = self.coordinator.take(answer)
        if taken is None:
            return
        if taken.missing is not None:
            self._context.publish("missing_effects", taken.stamp, taken.missing.statuses)
            for line in taken.missing.where[:MAXIMUM_LINES]:
                self._context.info(f"where: {line.strip()}")
            self._context.info(f"diagnosis: {taken.missing.line}")
        if taken.model is not None:
            self._adopt(taken.model)
        if taken.ladder is not None:
            self._publish_ladder(taken.stamp, taken.ladder)
            if taken.ladder.line != self._logged:
                self._logged = taken.ladder.line
                self._context.info(f"ladder: {self._logged}")
        self.coordinator.go_on(taken)

    def _publish_ladder(self, stamp: int, ladder: LadderSummary) -> None:
        self._context.publish("ladder", stamp, ladder.statuses)

    def health(self) -> Status:
        """Return what is under way, or the newest result."""
        coordinator, progress = self.coordinator, self._context.jobs.progress
        order = coordinator.ordered or coordinator.waiting
        values = {
            "order": order,
            "experiment": "" if coordinator.span is None else "running",
            "experiments": str(self._data.experiments),
            "armed": str(self._whiteness.armed).lower(),
            "automatic": str(self._autopilot()),
        }
        text, level = "none yet", Level.OK
        if coordinator.busy:
            text = order
            if progress is not None and coordinator.ordered:
                text += f" {100.0 * progress[0]:.0f} %, {progress[1]}"
        elif coordinator.missing is not None:
            head = coordinator.missing.statuses[0]
            text, level = head.message, head.level
        return Status("diagnosis", text, level, values)
