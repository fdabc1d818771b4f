"""All parts of the estimator behind one interface: samples in, messages out."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import FitSummary, Level, ParameterSummary, Status
from idloop_nodes.codec.joints import OutputPacker, output_columns
from idloop_nodes.estimation.diagnosis_schedule import DiagnosisSchedule
from idloop_nodes.estimation.estimator_context import EstimatorContext
from idloop_nodes.estimation.evidence import EvidenceSchedule
from idloop_nodes.estimation.fits import FitSchedule
from idloop_nodes.estimation.prediction import Prediction, RecursiveModel
from idloop_nodes.estimation.sample_input import Sample, SampleInput
from idloop_nodes.estimation.wear import WearSchedule
from idloop_nodes.service_calls import ExperimentClient, ExperimentEnd
from idloop_nodes.streams.rates import RateCounter

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop_nodes.progress import Progress

FORGET_PERIOD = SECOND // 2  # between two deletions of old samples [ns]


class Estimator:
    """Gives each block of samples to the parts; `adopted` takes the model of a new step of the ladder."""

    def __init__(
        self,
        context: EstimatorContext,
        model: Model,
        publisher: Callable[[str], Callable[[bytes], None]],
        client: ExperimentClient,
        end: ExperimentEnd,
        adopted: Callable[[Model], None],
    ) -> None:
        self.model = model
        self._context, self._jobs, self._buffer, self._adopted = context, context.jobs, context.buffer, adopted
        self.input = SampleInput(model, context.period_ns, context.lockstep, self._buffer, self.restart)

        def samples(name: str) -> Callable[[int, Sequence[float]], None]:
            publish, packer = publisher(f"estimator/{name}"), OutputPacker(output_columns(model))
            return lambda stamp, row: publish(packer.pack(stamp, row))

        self._prediction = Prediction(context.parameters, samples("prediction"), samples("residual"))
        self._recursion = RecursiveModel(context, model, samples("innovation"))
        self.fits = FitSchedule(context, self._judged)
        self.diagnosis = DiagnosisSchedule(context, client, model, self._adopt)
        self._evidence = EvidenceSchedule(
            context, model, lambda: self.diagnosis.coordinator.missing, self.diagnosis.take_evidence, end
        )
        self._wear = WearSchedule(context, model)
        self._samples = RateCounter()
        self._forgot = 0
        self._warned = 0
        self._resets = 0
        self._prediction.warm_up(model)

    # models

    def set_model(self, model: Model, *, other_machine: bool) -> None:
        """Begin again with a model that the user has chosen: other effects, or the model of another machine."""
        self.model = model
        self._prediction.begin(model)
        last = self.input.last
        if other_machine:
            self.diagnosis.restart()
            self.diagnosis.last = last
            self._wear.begin(model)
        self.diagnosis.another_model(model)
        self._evidence.begin(model)
        with contextlib.suppress(InputError):  # too few samples
            self.fits.fit_now(model, last)

    def _adopt(self, model: Model) -> None:
        """Continue with the model of a new step."""
        self.model = model
        self._prediction.go_on(model)
        self.diagnosis.another_model(model)
        self._evidence.begin(model)
        self._adopted(model)

    def restart_evidence(self) -> None:
        """Score effects from the newest sample on: its parameters have changed."""
        self._evidence.begin(self.model)

    def restart(self) -> None:
        """Forget everything: the clock was set back, a new run begins."""
        self._resets += 1
        self._buffer.clear()
        for part in (self.input, self.fits, self.diagnosis, self._evidence, self._wear):
            part.restart()
        self._prediction.begin(self.model)
        self._recursion.begin()

    # samples and results

    @property
    def holding(self) -> bool:
        """Lock-step: whether simulated time waits for a result, so that equal runs give equal results."""
        values = self._context.parameters
        deciding = (values["auto_diagnose"] or values["end_when_decided"]) and self._jobs.busy
        return self._context.lockstep and (deciding or self.diagnosis.coordinator.busy or self._evidence.end.busy)

    def update(self, progress: Progress) -> None:
        """Take the answers of the worker, then process the samples whose commands are known."""
        self._jobs.deliver()
        self.diagnosis.follow(progress)
        self._evidence.end.poll()
        while not self.holding:
            block = self.input.next_block((self.fits.due, self.diagnosis.due, self._evidence.due), progress.end)
            if not block:
                break
            self._process(block, progress)

    def _process(self, block: list[Sample], progress: Progress) -> None:
        last = self.diagnosis.last = block[-1][0]
        self._samples.count += len(block)
        commands, origin = self.input.commands_of(block), self._buffer.first or 0
        for follower in (self._prediction, self._recursion):
            healthy = not follower.failure
            follower.take(origin, block, commands)
            if healthy and follower.failure:
                self._context.error(follower.failure)
        self.fits.follow(self.model, last)
        self._evidence.follow(last)
        self._wear.follow(last)
        self.diagnosis.follow(progress)
        for one in self._buffer.computed[self._warned :]:
            self._context.warn(one.text)
        self._warned = len(self._buffer.computed)
        self._forget(last)

    def _forget(self, last: int) -> None:
        """Delete samples that no part needs any more."""
        if 0 <= last - self._forgot < FORGET_PERIOD:
            return
        self._forgot = last
        window, validation = self.fits.spans
        longest = max(window, self._context.nanoseconds("diagnose_window")) + validation
        oldest = last - max(longest, self._context.nanoseconds("fit_period")) - 2 * SECOND
        needed = (self.diagnosis.oldest, self._evidence.oldest, self._wear.oldest)
        self._buffer.forget(min([oldest, *(one for one in needed if one is not None)]))

    def _judged(self, fit: FitSummary, estimates: Sequence[ParameterSummary], stamp: int) -> None:
        self._evidence.take_fit(fit, estimates, stamp)
        self.diagnosis.take_fit(fit)

    # end and health

    def finish(self, last: int) -> bool:
        """Order what is left at the end of a run, its last sample at `last` [ns]; return whether all is done."""
        if not self._wear.busy:
            self._wear.finish(last)
        if any(one.busy for one in (self.diagnosis.coordinator, self._evidence, self._wear, self._jobs)):
            return False
        self._recursion.publish_coefficients(last)
        return True

    def health(self) -> list[Status]:
        """Return rates, what waits, the newest fit, and what is under way."""
        rate, failure = self._samples.rate(), self._prediction.failure
        values = {
            "samples": str(self._samples.count),
            "rate": f"{rate:.1f}",
            "waiting": str(self.input.waiting),
            "unreadable": str(self.input.unreadable),
            "restarts": str(self._resets),
        }
        return [
            Status("prediction", failure or f"{rate:.0f} samples/s", Level.ERROR if failure else Level.OK, values),
            self.fits.health(),
            *self._recursion.health(),
            *self._wear.health(),
            *self._evidence.health(),
            self.diagnosis.health(),
        ]
