"""From the estimator's messages to the plain objects that the page shows, and to its state."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.diagnosis import Candidate, Ladder, UnknownStructure
from idloop.physics.model_file import from_text
from idloop.reporting.estimates import with_interval
from idloop.reporting.figures.effects import Decided
from idloop.reporting.next_experiment import read_next
from idloop.reporting.terms import effect_words
from idloop.reporting.workbench.state import (
    AUTOMATIC,
    WARN,
    Activity,
    Evidence,
    Fit,
    Health,
    Missing,
    Note,
    TrustedEstimate,
)
from idloop_nodes.codec import (
    EvidenceSummary,
    FitSummary,
    LadderSummary,
    MissingSummary,
    Status,
    evidence_from_statuses,
    fit_from_statuses,
    ladder_from_statuses,
    missing_from_statuses,
    parameters_from_statuses,
)
from idloop_nodes.estimation.diagnosis_jobs import ADD_BEST, DIAGNOSE, EFFECTS, SUGGEST, UNDO, MotionLimits
from idloop_nodes.workbench_page.source import LiveSource

if TYPE_CHECKING:
    from idloop.diagnosis.design.suggest import Suggestion
    from idloop.physics import Model


NANO = 1e-9
MAXIMUM_POINTS = 600  # that the page draws: more points than a figure has pixels for
_PROGRESS = re.compile(r"\b(\d+) %,? ?(.*)")
_EFFECT = re.compile(r"\w+@[\w.]+")
# Text of each order.
_WORK = {
    DIAGNOSE: "looking for what is missing",
    ADD_BEST: "adding the effect and fitting again",
    UNDO: "taking the last step back",
    EFFECTS: "fitting with the chosen effects",
    SUGGEST: "working out the next experiment",
}


def fit_of(summary: FitSummary) -> Fit:
    """Return the newest fit."""
    first, last = summary.validation_window
    return Fit(summary.fit, summary.fit_train, (last - first) * NANO, summary.effects, summary.error)


def missing_of(summary: MissingSummary, folder: Path | None) -> Missing:
    """Return the newest diagnosis; what a model file names beside it lies in the folder."""
    document = summary.document
    if document is None:
        return Missing(summary.verdict, summary.line, error=summary.error)
    unknown, fitted = document["unknown"], summary.fitted_models
    candidates = [Candidate.from_dict(one) for one in document["candidates"]]
    return Missing(
        summary.verdict,
        summary.line,
        tuple(
            replace(one, model=from_text(fitted[one.name], folder)) if one.name in fitted else one for one in candidates
        ),
        summary.set,
        summary.pair,
        tuple(document["untestable"]),
        tuple(document["gate"]["findings"]),
        None if unknown is None else UnknownStructure.from_dict(unknown),
    )


def evidence_of(summary: EvidenceSummary, before: Evidence | None) -> Evidence:
    """Return how the evidence has grown, with the newest scores after the earlier ones."""
    seconds: tuple[float, ...] = ()
    lines: dict[str, tuple[float, ...]] = {}
    if before is not None and before.effects == summary.effects and before.seconds[-1:] <= (summary.seconds,):
        seconds, lines = before.seconds, dict(before.lines)
    # A stretch that could not be scored, or the end of the experiment, is no new point.
    if summary.looks and seconds[-1:] != (summary.seconds,):
        unknown = (math.nan,) * len(seconds)
        now = {one.name: one.log_e for one in summary.candidates}
        lines = {
            name: (*lines.get(name, unknown), now.get(name, math.nan))[-MAXIMUM_POINTS:]
            for name in dict.fromkeys((*lines, *now))
        }
        seconds = (*seconds, summary.seconds)[-MAXIMUM_POINTS:]
    decided = {
        one.name: _decided(one.decided_samples, summary, seconds, lines[one.name])
        for one in summary.candidates
        if one.decided_samples is not None and one.name in lines
    }
    estimates = tuple(
        TrustedEstimate(
            one.name, f"{with_interval(one.value, one.stderr)} {one.unit}".strip(" -"), one.trusted, one.why
        )
        for one in summary.parameters
    )
    return Evidence(summary.line, summary.effects, seconds, lines, summary.threshold, decided, estimates, summary.ended)


def _decided(samples: int, summary: EvidenceSummary, seconds: Sequence[float], values: Sequence[float]) -> Decided:
    """Where an effect was decided; at the threshold where the page has come later."""
    at = summary.seconds * samples / max(summary.samples, 1)
    nearest = min(range(len(seconds)), key=lambda index: abs(seconds[index] - at))
    seen = abs(seconds[nearest] - at) <= 0.5 * summary.seconds / max(summary.looks, 1)
    return Decided(at, samples, values[nearest] if seen else summary.threshold)


def ladder_of(summary: LadderSummary, folder: Path | None) -> Ladder | None:
    """Return the ladder with its models; None while there is none."""
    return None if summary.document is None else Ladder.from_dict(summary.document, folder)


def suggestion_of(document: Mapping[str, Any] | None, folder: Path | None) -> Suggestion | None:
    """Return the next experiment with its rivals, which are simulated for its figures; None where nobody sent them."""
    return read_next(dict(document), folder) if document and "rivals" in document else None


def activity_of(status: Status) -> Activity | None:
    """Return what the estimator works on, from its check of the diagnosis; None while it does nothing."""
    order = status.values.get("order")
    if order:
        found = _PROGRESS.search(status.message)
        step = _EFFECT.sub(lambda effect: effect_words(effect[0]), found[2]) if found else ""
        parts = [_WORK.get(order, order.replace("_", " ")), "" if "objective" in step else step]
        return Activity(": ".join(filter(None, parts)), float(found[1]) / 100.0 if found else None)
    if status.values.get("experiment"):
        return Activity("the experiment is running")
    return None


def automatic_of(status: Status) -> tuple[str, ...]:
    """Return what the estimator does without being asked, from its check of the diagnosis."""
    on = status.values.get("automatic", "").split()
    return tuple(one for one in AUTOMATIC if one in on)


def health_of(statuses: Sequence[tuple[Status, bool]]) -> tuple[Health, ...]:
    """Return the checks of all nodes by name; True marks those that have fallen silent."""
    return tuple(
        Health(
            one.name, 3 if silent else int(one.level), "nothing heard any more" if silent else one.message, one.values
        )
        for one, silent in sorted(statuses, key=lambda pair: pair[0].name)
    )


def limits_of(limits: MotionLimits, input_unit: str, position_unit: str) -> tuple[tuple[str, str], ...]:
    """Return what an experiment may do, undeclared limits included."""
    what, unit = (
        ("amplitude of the reference", position_unit)
        if limits.adds_to == "reference"
        else ("amplitude of the command", input_unit)
    )
    low, high = limits.position_min, limits.position_max
    given = "not limited by the excitation"
    span = given if low is None and high is None else f"{_end(low, 'any')} to {_end(high, 'any')} {position_unit}"
    return (
        (what, given if limits.amplitude is None else f"at most {limits.amplitude:g} {unit}"),
        ("position", span),
        ("velocity", given if limits.velocity is None else f"at most {limits.velocity:g} {position_unit}/s"),
    )


def _end(value: float | None, otherwise: str) -> str:
    return otherwise if value is None else f"{value:g}"


class PageResults:
    """Takes results in, one method for each topic: `takers`. The estimator starts with `model`."""

    def __init__(self, source: LiveSource, model: Model) -> None:
        self._source, self._page, self._base = source, source.state, model
        self.takers: dict[str, Callable[[list[Status]], None]] = {
            "estimator/fit": self.take_fit,
            "estimator/parameters": self.take_parameters,
            "estimator/missing_effects": self.take_missing,
            "estimator/evidence": self.take_evidence,
            "estimator/ladder": self.take_ladder,
        }

    def take_fit(self, statuses: list[Status]) -> None:
        """Show a fit; take over the structure of its model, whose values come with its parameters."""
        fit = fit_of(fit_from_statuses(statuses))
        self._page.change(fit=fit)
        ladder = self._page.snapshot.ladder
        # A fit that was under way when a step was taken is one of the model before it.
        late = ladder is not None and fit.effects != tuple(ladder.model.effect_names)
        if fit.error or late or fit.effects == tuple(self._source.model.effect_names):
            return
        own = self._base.effect_names
        self._source.model = self._base.with_effects([name for name in fit.effects if name not in own])

    def take_parameters(self, statuses: list[Status]) -> None:
        """Take over the values of the newest fit."""
        told = parameters_from_statuses(statuses)
        found = {one.name: one.value for one in told}
        model = self._source.model
        if not set(model.free) <= set(found) <= {one.name for one in model.parameters}:
            return  # of a fit of the model before the last step, which may have had more or fewer effects
        fitted = model.with_values(found, {one.name: one.stderr for one in told if one.stderr is not None})
        # The same estimates may come again, with another judgement of whether they may be trusted.
        if fitted.values != model.values or self._page.snapshot.assessment is None:
            self._source.model = fitted
            self._source.want("assess")

    def take_missing(self, statuses: list[Status]) -> None:
        """Show a diagnosis."""
        self._page.change(
            missing=missing_of(missing_from_statuses(statuses), self._base.folder),
            looks=self._page.snapshot.looks + 1,
            pictures=None,
            activity=None,
        )
        self._source.want("pictures")

    def take_evidence(self, statuses: list[Status]) -> None:
        """Show the newest evidence after the earlier."""
        summary = evidence_from_statuses(statuses)
        self._page.change(evidence=evidence_of(summary, self._page.snapshot.evidence))

    def take_ladder(self, statuses: list[Status]) -> None:
        """Show the ladder; take over the model of its newest step."""
        summary = ladder_from_statuses(statuses)
        ladder = ladder_of(summary, self._base.folder)
        before = self._page.snapshot
        suggested = summary.suggested_experiment
        changes: dict[str, Any] = {"ladder": ladder, "suggested": suggested}
        if suggested != before.suggested:
            changes["suggestion"] = suggestion_of(suggested, self._base.folder)
        if summary.error:
            changes["note"] = Note(summary.error, WARN)
        if ladder is not None:
            effects = tuple(ladder.model.effect_names)
            if before.ladder is None or len(before.ladder.steps) != len(ladder.steps) or effects != before.effects:
                # What was missing from another model need not be missing from this one.
                if before.missing is not None and before.ladder is not None and effects != before.effects:
                    changes |= {"missing": None, "pictures": {}}
                changes["model"] = ladder.model
                self._source.want("assess")
            changes["activity"] = None
        self._page.change(**changes)
