"""From the estimator's messages to the plain objects that the page shows."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from idloop.diagnosis import Candidate, Ladder, UnknownStructure
from idloop.documents import read_json
from idloop.physics.model_file import from_text
from idloop.reporting.estimates import with_interval
from idloop.reporting.figures.evidence import Decided
from idloop.reporting.terms import effect_words
from idloop.reporting.workbench.state import AUTOMATIC, Activity, Evidence, Fit, Health, Missing, TrustedEstimate
from idloop_nodes.codec import EffectSummary, EvidenceSummary, FitSummary, LadderSummary, MissingSummary, Status
from idloop_nodes.estimation.diagnosis_jobs import ADD_BEST, DIAGNOSE, EFFECTS, SUGGEST, UNDO, MotionLimits

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
    unknown = summary.unknown
    return Missing(
        summary.verdict,
        summary.line,
        tuple(candidate_of(one, folder) for one in summary.candidates),
        summary.set,
        summary.pair,
        summary.untestable,
        summary.findings,
        None
        if unknown is None
        else UnknownStructure(
            unknown.variable,
            unknown.unit,
            unknown.force_unit,
            np.array(unknown.at),
            np.array(unknown.force),
            np.array(unknown.band),
            unknown.share,
            unknown.text,
        ),
        summary.error,
    )


def candidate_of(one: EffectSummary, folder: Path | None) -> Candidate:
    """Return one effect with the model that was fitted with it."""
    return Candidate(
        one.effect,
        one.at,
        one.testable,
        one.why,
        one.text,
        math.nan if one.gain is None else one.gain,
        1.0 if one.p_value is None else one.p_value,
        one.explains,
        {
            name: {"value": value.value, "stderr": value.stderr, "unit": value.unit}
            for name, value in one.parameters.items()
        },
        model=from_text(one.fitted_model, folder) if one.fitted_model else None,
        replaces=one.replaces or None,
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
    document = read_json(summary.document, "ladder") if summary.document else None
    return None if document is None else Ladder.from_dict(document, folder)


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
