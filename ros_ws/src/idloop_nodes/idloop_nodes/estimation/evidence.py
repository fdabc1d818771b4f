"""When new samples are scored for missing effects, what is published of it, and when the experiment may end."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from idloop.worker_process import Report
from idloop_nodes.codec import (
    EffectEvidence,
    EvidenceSummary,
    FitSummary,
    Level,
    MissingSummary,
    ParameterSummary,
    Status,
    evidence_to_statuses,
    parameters_to_statuses,
)
from idloop_nodes.estimation.estimator_context import SHORTEST, EstimatorContext
from idloop_nodes.service_calls import ExperimentEnd

if TYPE_CHECKING:
    from idloop.diagnosis.evidence.live_evidence import LiveEvidence
    from idloop.physics import Model
    from idloop.records import Record

MINIMUM_LOOKS = 2  # before which no estimate may be trusted


def score(
    report: Report,
    *,
    model: Model,
    state: bytes,
    earlier: Record,
    new: Record,
    stamp: int,
    level: float,
    minimum_improvement: float,
    catalogue: Sequence[str],
) -> tuple[bytes, EvidenceSummary]:
    """Score effects on a stretch that ends at `stamp` [ns]; `state`: pickle of the evidence so far, or empty."""
    from idloop.diagnosis.evidence.live_evidence import LiveEvidence

    before = LiveEvidence(model, level, minimum_improvement, tuple(catalogue))
    evidence: LiveEvidence = pickle.loads(state) if state else before  # noqa: S301  (our own estimator's)
    evidence = evidence.update([earlier], new, stamp)
    return pickle.dumps(evidence), summarise_evidence(evidence, stamp)


def summarise_evidence(evidence: LiveEvidence, stamp: int) -> EvidenceSummary:
    """Return the contents of ``estimator/evidence``, without the estimates."""
    candidates = []
    for name, log_e in evidence.logs.items():
        when = evidence.decided.get(name)
        when_decided, samples = (None, None) if when is None else (when.stamp, when.samples)
        candidates.append(EffectEvidence(name, log_e, when_decided, samples, evidence.pending(name)))
    same = {name: getattr(evidence, name) for name in ("level", "threshold", "looks", "samples", "seconds", "doubtful")}
    model = evidence.model
    return EvidenceSummary(model.name, tuple(model.effect_names), stamp, candidates=tuple(candidates), **same)


class EvidenceSchedule:
    """Scores every stretch of new samples once, judges the estimates, and ends the experiment if asked."""

    def __init__(
        self,
        context: EstimatorContext,
        model: Model,
        missing: Callable[[], MissingSummary | None],
        diagnose: Callable[[str], None],
        end: ExperimentEnd,
    ) -> None:
        self._context = context
        self._missing, self._diagnose, self.end = missing, diagnose, end
        self._from: int | None = None  # stamp from which on nothing was scored [ns]
        self._newest: int | None = None  # stamp after the newest sample [ns]
        self.begin(model)

    @property
    def _span(self) -> int:
        return self._context.nanoseconds("evidence_period")

    @property
    def _memory(self) -> int:
        return self._context.nanoseconds("diagnose_window")

    @property
    def busy(self) -> bool:
        """Whether a job, or the end of the experiment, is under way."""
        return self._ordered is not None or self.end.busy

    @property
    def due(self) -> int | None:
        """Stamp after the last sample of the next stretch; None when nothing is scored."""
        return None if self._from is None or not self._wanted else self._from + self._span

    @property
    def oldest(self) -> int | None:
        """Stamp from which on samples are still needed [ns]."""
        return None if self._from is None or not self._wanted else self._from - self._memory

    @property
    def _wanted(self) -> bool:
        return self._span > 0 and not self.summary.ended

    def begin(self, model: Model) -> None:
        """Score effects against another model, from the newest sample on."""
        self._model, self._state = model, b""
        self._ordered: object = None  # stands for the job under way
        self._fit: FitSummary | None = None
        self._estimates: tuple[ParameterSummary, ...] = ()
        self.summary = EvidenceSummary(model.name, tuple(model.effect_names))
        self._from = self._newest

    def restart(self) -> None:
        """A new run of the clock."""
        self._newest = None
        self.begin(self._model)

    def follow(self, last: int) -> None:
        """Order what is due after the sample `last` [ns]."""
        if self._context.buffer.first is None:
            return
        self._newest = last + self._context.period_ns
        if self._from is None or not self._wanted:
            # The first samples are fitted, not scored.
            self._from = self._newest if self.summary.looks else self._context.buffer.first + self._span
        self._next()

    def _next(self) -> None:
        context = self._context
        due, newest, first = self.due, self._newest, context.buffer.first
        if due is None or newest is None or first is None or self._ordered is not None:
            return
        if newest + context.period_ns // 2 < due or (context.jobs.busy and not context.lockstep):
            return
        start, stop = due - self._span, due if context.lockstep else newest
        self._from = stop
        earlier, new = context.buffer.split(self._model, max(first, start - self._memory), start, stop)
        if min(earlier.time.size, new.time.size) < SHORTEST or not (earlier.input.size and new.input.size):
            return
        settings = {name: context.parameters[name] for name in ("level", "minimum_improvement", "catalogue")}
        work = partial(score, model=self._model, state=self._state, earlier=earlier, new=new, stamp=stop, **settings)
        order = self._ordered = object()

        def done(result: tuple[bytes, EvidenceSummary]) -> None:
            if order is self._ordered:  # else of a model before
                self._take(*result)

        def failed(reason: str) -> None:
            done((self._state, replace(self.summary, stamp=stop, error=reason)))

        context.jobs.submit(work, done, failed)

    def _take(self, state: bytes, summary: EvidenceSummary) -> None:
        """Publish the newest evidence; end the experiment where that is asked for."""
        self._ordered = None
        before, self._state = self.summary, state
        self.summary = replace(summary, ended=before.ended)
        self._judge()
        found = [name for name in self.summary.decided if name not in before.decided]
        if found:
            self._context.info(f"the evidence has decided: {', '.join(found)}")
        enough = self._enough()
        if enough and self._context.parameters["end_when_decided"] and not self.summary.ended:
            self.summary = replace(self.summary, ended=enough)
            self._context.info(f"the experiment ends: {enough}")
            self.end.end()
            if self.summary.decided:
                self._diagnose("the evidence has decided")
        self._context.publish("evidence", self.summary.stamp, evidence_to_statuses(self._context.name, self.summary))
        if self._estimates:
            self._publish_parameters(self.summary.stamp, self._estimates)
        self._next()

    def take_fit(self, summary: FitSummary, estimates: Sequence[ParameterSummary], stamp: int) -> None:
        """Take in the newest estimates and publish them with whether they may be trusted."""
        if summary.effects == tuple(self._model.effect_names):
            self._fit, self._estimates = summary, tuple(estimates)
            self._judge()
            estimates = self._estimates
        self._publish_parameters(stamp, estimates)

    def _publish_parameters(self, stamp: int, estimates: Sequence[ParameterSummary]) -> None:
        self._context.publish("parameters", stamp, parameters_to_statuses(self._context.name, estimates))

    def _judge(self) -> None:
        """Judge whether each estimate may be trusted."""
        from idloop.validation.trust import ModelValidation, trust

        missing, found = self._missing(), self.summary
        diagnosed = () if missing is None or missing.verdict != "missing" else (*missing.set, *missing.pair)
        standing = ModelValidation(
            {} if self._fit is None else self._fit.missed,
            tuple(dict.fromkeys((*found.decided, *diagnosed))),
            found.doubtful,
            found.seconds if found.looks >= MINIMUM_LOOKS else 0.0,
            missing is not None and missing.verdict == "unknown_structure",
        )
        values, judged = self._context.parameters, []
        for one in self._estimates:
            answer = trust(
                one.value,
                one.stderr,
                standing,
                at_bound=one.at_bound,
                largest_stderr=values["trusted_stderr"],
                largest_error=values["trusted_error"],
            )
            judged.append(replace(one, trusted=answer.trusted, why=answer.why))
        self._estimates = tuple(judged)
        self.summary = replace(found, parameters=self._estimates)

    def _enough(self) -> str:
        """Why no more samples are needed; empty while they are."""
        values = self._context.parameters
        if self.summary.decided and not (values["auto_add"] or values["auto_experiment"]):
            return f"decided: {', '.join(self.summary.decided)}"
        if self._estimates and all(one.trusted for one in self._estimates):
            return "every estimate may be trusted"
        return ""

    def health(self) -> list[Status]:
        """Return the newest evidence; nothing when none is scored."""
        if not self._span:
            return []
        found = self.summary
        values = {
            "looks": str(found.looks),
            "samples": str(found.samples),
            "trusted": " ".join(one.name for one in self._estimates if one.trusted),
            "ended": found.ended,
        }
        text = found.line if found.looks or found.error else "no data scored yet"
        return [Status("evidence", f"experiment ended: {found.ended}" if found.ended else text, Level.OK, values)]
