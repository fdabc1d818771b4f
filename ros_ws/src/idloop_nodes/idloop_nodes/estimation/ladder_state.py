"""The worker's state of a model: its ladder, what the newest diagnosis would add, and both as contents of messages."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from idloop.diagnosis import Ladder, Step, add_effect, diagnose, refine
from idloop.errors import InputError
from idloop.physics import parse_effect
from idloop.validation import compare
from idloop.worker_process import Report
from idloop_nodes.codec import ladder_to_statuses, missing_to_statuses
from idloop_nodes.estimation.diagnosis_jobs import DiagnosisAnswer, DiagnosisOrder

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Diagnosis
    from idloop.physics import Model


@dataclass
class LadderState:
    """Ladder and newest findings; every method carries out one order."""

    ladder: Ladder | None = None  # None before the first order
    diagnosis: Diagnosis | None = None  # the newest one, without its fits; None when the model has changed since
    # The next experiment, as `idloop suggest` writes it, and under ``experiment`` what the excitation receives
    suggested: dict[str, Any] | None = None

    def diagnose(self, order: DiagnosisOrder, report: Report) -> DiagnosisAnswer:
        """Find out what is missing."""
        found = diagnose(order.model, order.records, effects=order.catalogue or None, **_settings(order, report))
        self.diagnosis = found
        self.suggested = None
        if self.ladder is None:
            self.ladder = Ladder((_step(found.model, order),), criterion=found.criterion, level=order.level)
        else:
            self.ladder = _measured_anew(self.ladder, order)
        self.ladder = self.ladder.with_findings(found)
        where = compare(self.ladder.model, order.validation[-1]).where.lines() if order.validation else []
        return self._answer(order, missing=missing_to_statuses(order.node, found, where, order.windows))

    def add_best_effect(self, order: DiagnosisOrder, report: Report) -> DiagnosisAnswer:
        """Add what the newest diagnosis names first: an effect, or both of a pair."""
        best = None if self.diagnosis is None else self.diagnosis.best
        if self.ladder is None or self.diagnosis is None or best is None:
            raise InputError("no effect is known to be missing: diagnose first")
        ladder = self.ladder.undecided()
        if self.diagnosis.pair is not None:
            for rung in self.diagnosis.rungs:
                ladder = ladder.with_rung(rung, order.records, order.validation)
            return self._climb(order, ladder)
        if ladder.added:
            # Earlier effects may be needless now: that takes a refit of its own.
            ladder = refine(
                ladder.model,
                order.records,
                order.validation,
                effects=[best.name],
                most=len(ladder.added) + 1,
                ladder=ladder,
                **_settings(order, report),
            )
        if best.name not in ladder.added and best.model is not None:
            ladder = replace(ladder, steps=(*ladder.steps, _step(best.model, order, best)))
        # The evidence is that of the whole catalogue.
        last = ladder.steps[-1]
        if last.added is not None:
            added = replace(last.added, p_value=best.p_value, explains=best.explains, why=best.why)
            last = replace(last, added=added, set=self.diagnosis.set, p_value=best.p_value)
        return self._climb(order, replace(ladder, steps=(*ladder.steps[:-1], last)))

    def undo(self, order: DiagnosisOrder, report: Report) -> DiagnosisAnswer:
        """Take the last step back."""
        if self.ladder is None:
            raise InputError("there is no step to take back")
        return self._climb(order, self.ladder.undo())

    def effects(self, order: DiagnosisOrder, report: Report) -> DiagnosisAnswer:
        """Climb to exactly the effects of the order, from the highest step that has none but these."""
        names = ["@".join(parse_effect(text)[:2]) for text in order.effects]
        ladder = self.ladder
        if ladder is None:
            # The order's model has the effects already; the ladder begins without them.
            ladder = refine(
                order.model.without_effects(names),
                order.records,
                order.validation,
                effects=order.catalogue or None,
                most=0,
                **_settings(order, report),
            )
        own = set(ladder.steps[0].model.effect_names)
        while len(ladder.steps) > 1 and not set(ladder.model.effect_names) - own <= set(names):
            ladder = ladder.undo()
        for text, name in zip(order.effects, names, strict=True):
            if name not in ladder.model.effect_names:
                ladder = add_effect(ladder, text, order.records, order.validation, seed=order.seed, progress=report)
        return self._climb(order, ladder)

    def suggest(self, order: DiagnosisOrder, report: Report) -> DiagnosisAnswer:
        """Work out the experiment that settles what the newest diagnosis has left open."""
        from idloop.diagnosis.design.next_experiment import suggest_next
        from idloop.diagnosis.design.suggest import Limits
        from idloop.reporting.next_experiment import next_document, predicted_motion

        if self.diagnosis is None:
            raise InputError("nothing is undecided: diagnose first")
        limits = order.limits
        found = suggest_next(
            self.diagnosis,
            order.records,
            Limits(
                command=limits.amplitude if limits.adds_to == "command" else None,
                position=limits.position,
                velocity=limits.velocity,
            ),
            seed=order.seed,
            start=_newest_position(order),
            progress=report,
        )
        if found is None:
            raise InputError("nothing is undecided that an experiment could settle")
        self.suggested = {**next_document(found), "motion": predicted_motion(found)}
        shift = found.start if limits.absolute else 0.0
        self.suggested["experiment"] = {"signal": _for_excitation(found.signal, shift), "adds_to": found.adds_to}
        return self._answer(order)

    # answers

    def _climb(self, order: DiagnosisOrder, ladder: Ladder) -> DiagnosisAnswer:
        self.ladder = replace(ladder, candidates=(), suggested_experiment=None)
        self.diagnosis = self.suggested = None
        return self._answer(order, model=ladder.model)

    def _answer(self, order: DiagnosisOrder, **more: Any) -> DiagnosisAnswer:
        ladder = None
        if self.ladder is not None:
            ladder = ladder_to_statuses(order.node, self.ladder, self.suggested, order.experiments)
        return DiagnosisAnswer(order.verb, order.stamp, pickle.dumps(self), ladder=ladder, **more)


def _settings(order: DiagnosisOrder, report: Report) -> dict[str, Any]:
    """Arguments that `diagnose` and `refine` share."""
    names = ("level", "criterion", "minimum_improvement", "seed")
    return {name: getattr(order, name) for name in names} | {"progress": report}


def _step(model: Model, order: DiagnosisOrder, added: Candidate | None = None) -> Step:
    return Step(added, model).measured(model, order.records, order.validation)


def _measured_anew(ladder: Ladder, order: DiagnosisOrder) -> Ladder:
    """New data may have come in: every step is judged on the same."""
    if len(ladder.steps[-1].train.get("records", {})) == len(order.records):
        return ladder
    steps = tuple(step.measured(step.model, order.records, order.validation) for step in ladder.steps)
    return replace(ladder, steps=steps)


def _newest_position(order: DiagnosisOrder) -> float | None:
    """Position at which the axis is, as far as the data show."""
    import numpy as np

    for column, output in enumerate(order.model.outputs):
        if output.field == "position" and output.body == order.model.bodies[0] and order.validation:
            measured = order.validation[-1].output[:, column]
            known = measured[np.isfinite(measured)]
            return float(known[-1]) / output.scale if len(known) else None
    return None


def _for_excitation(signal: Mapping[str, Any], shift: float) -> dict[str, Any]:
    """The signal as the excitation node builds it, on its own period, around where the axis is."""
    values = {name: value for name, value in signal.items() if name != "sample_time" and value is not None}
    if shift:
        values["offset"] = values.get("offset", 0.0) + shift
    return values
