"""Results of the library as contents of messages."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from idloop_nodes.codec import (
    EffectSummary,
    Estimate,
    LadderSummary,
    Measures,
    MissingSummary,
    StepSummary,
    UnknownSummary,
)
from idloop_nodes.codec.key_values import as_json

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Diagnosis, Ladder, Step, UnknownStructure

Span = tuple[int, int]


def summarise_diagnosis(diagnosis: Diagnosis, where: Sequence[str], windows: Sequence[Span]) -> MissingSummary:
    """Return the contents of ``estimator/missing_effects``."""
    return MissingSummary(
        model=diagnosis.model.name,
        effects=tuple(diagnosis.model.effect_names),
        verdict=diagnosis.verdict,
        candidates=tuple(summarise_candidate(one) for one in diagnosis.candidates),
        set=tuple(diagnosis.set),
        pair=diagnosis.pair or (),
        untestable=tuple(diagnosis.untestable),
        findings=tuple(diagnosis.gate.findings),
        where=tuple(where),
        unknown=None if diagnosis.unknown is None else summarise_unknown(diagnosis.unknown),
        criterion=diagnosis.criterion,
        level=diagnosis.level,
        windows=tuple(windows),
        document=as_json(diagnosis.to_dict()),
    )


def summarise_candidate(one: Candidate) -> EffectSummary:
    """Return one effect, the model that was fitted with it as text."""
    return EffectSummary(
        effect=one.effect,
        at=one.at,
        testable=one.testable,
        p_value=_finite(one.p_value),
        explains=float(one.explains),
        gain=_finite(one.gain),
        parameters={
            name: Estimate(float(values["value"]), _finite(values.get("stderr")), str(values.get("unit", "")))
            for name, values in one.parameters.items()
        },
        replaces=one.replaces or "",
        why=one.why,
        text=one.text,
        fitted_model="" if one.model is None else one.model.to_yaml(),
    )


def summarise_unknown(one: UnknownStructure) -> UnknownSummary:
    """Return the learnt curve."""
    at, force, band = (tuple(float(x) for x in values) for values in (one.at, one.force, one.band))
    return UnknownSummary(one.variable, one.unit, one.force_unit, at, force, band, float(one.share), one.text)


def summarise_ladder(
    ladder: Ladder, suggested: Mapping[str, Any] | None = None, experiments: int = 0, error: str = ""
) -> LadderSummary:
    """Return the contents of ``estimator/ladder``."""
    return LadderSummary(
        model=ladder.model.name,
        steps=tuple(summarise_step(step) for step in ladder.steps),
        verdict=ladder.verdict,
        untestable=tuple(ladder.untestable),
        suggested_experiment=None if suggested is None else dict(suggested),
        experiments=experiments,
        document=as_json({**ladder.to_dict(), "suggested_experiment": suggested}),
        error=error,
    )


def summarise_step(step: Step) -> StepSummary:
    """Return one step, its model as text."""
    return StepSummary(
        added=None if step.added is None else summarise_candidate(replace(step.added, model=None)),
        set=tuple(step.set),
        p_value=_finite(step.p_value),
        chosen_by="" if step.added is None else step.chosen_by,
        train=summarise_measures(step.train),
        validation=summarise_measures(step.validation),
        model=step.model.to_yaml(),
    )


def summarise_measures(measures: Mapping[str, Any]) -> Measures:
    """Return the errors by output; the single records are left to the file."""
    by_output = {name: dict(measures.get(name) or {}) for name in ("nrmse", "fit", "rmse")}
    return Measures(**by_output, force=_finite(measures.get("force")))


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
