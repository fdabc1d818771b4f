"""What is done to a model offline: diagnose, add, suggest. Runs in the worker and calls the library, no more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Diagnosis, Ladder, Step
    from idloop.diagnosis.candidate import Rung
    from idloop.diagnosis.design.suggest import Limits, Suggestion
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.reporting.residual_findings import ResidualFinding
    from idloop.validation.characteristic import Characteristic

Report = Callable[[float, str], None]


@dataclass(frozen=True)
class Study:
    """The data and how they are judged.

    Attributes
    ----------
    records, validation : tuple of Record
        What is fitted, and what the fits do not see.
    level : float
        Family-wise error rate.
    effects : tuple of str
        That are looked for; all when empty.
    limits : Limits or None
        Of a suggested experiment.
    duration : float or None
        Of a suggested experiment [s].
    minimum_improvement : float
        Part by which an effect must make errors on unseen samples smaller.
    """

    records: tuple[Record, ...]
    validation: tuple[Record, ...] = ()
    level: float = 0.01
    criterion: str = "auto"
    effects: tuple[str, ...] = ()
    seed: int = 0
    limits: Limits | None = None
    duration: float | None = None
    minimum_improvement: float = 0.01

    @property
    def options(self) -> tuple[str, ...]:
        """Words of the command line for how the data are judged; none for what is left as usual."""
        given = {
            "--level": self.level,
            "--criterion": self.criterion,
            "--seed": self.seed,
            "--minimum-improvement": 100.0 * self.minimum_improvement,
        }
        usual = (0.01, "auto", 0, 1.0)
        words = [
            w
            for (name, value), plain in zip(given.items(), usual, strict=True)
            if value != plain
            for w in (name, f"{value}")
        ]
        return (*words, *(word for name in self.effects for word in ("--effects", name)))


@dataclass(frozen=True)
class Found:
    """A diagnosis without its fits, the ladder as it is now, what the effects look like, and the residual tests."""

    diagnosis: Diagnosis
    ladder: Ladder
    pictures: dict[str, Characteristic]
    left: tuple[ResidualFinding, ...] = ()


def find_missing(study: Study, model: Model, ladder: Ladder | None, report: Report) -> Found:
    """Find out what a model lacks; without a ladder the fitted model becomes its first step."""
    from idloop.diagnosis import Ladder, diagnose
    from idloop.reporting.residual_findings import findings_on_records
    from idloop.reporting.workbench.assessment import draw_characteristics

    found = diagnose(
        model,
        study.records,
        level=study.level,
        criterion=study.criterion if ladder is None else ladder.criterion,
        minimum_improvement=study.minimum_improvement,
        effects=study.effects or None,
        seed=study.seed,
        progress=lambda share, text: report(0.9 * share, text),
    )
    pictures = draw_characteristics(
        found.candidates, study.records[0], lambda share, text: report(0.9 + 0.1 * share, text)
    )
    if ladder is None:
        ladder = Ladder((_step(study, found.model),), criterion=found.criterion, level=study.level)
    ladder = replace(
        ladder,
        verdict=found.verdict,
        candidates=tuple(replace(one, model=None) for one in found.candidates),
        untestable=found.untestable,
        findings=found.gate.findings,
        unknown=found.unknown,
        passed_over=found.passed_over,
        limits=found.gate.limits,
        response=found.response,
    )
    return Found(found, ladder, pictures, tuple(findings_on_records(found.model, study.records)))


def add(
    study: Study, model: Model, ladder: Ladder | None, found: Diagnosis | None, name: str, report: Report
) -> Ladder:
    """Add an effect: as a diagnosis fitted it where there is one, else fitted now."""
    from idloop.diagnosis import add_effect
    from idloop.diagnosis.screening.command_response import CommandResponse

    if ladder is None:
        from idloop.diagnosis import Ladder

        ladder = Ladder((_step(study, model),), level=study.level)
    rungs = () if found is None else _rungs(found, name)
    if not rungs:
        return add_effect(ladder, name, study.records, study.validation, seed=study.seed, progress=report)
    for number, rung in enumerate(rungs):
        report(number / len(rungs), f"errors with {rung.added.name}")
        ladder = _with(study, ladder, rung, "diagnosis" if found is not None and name in found.set else "user")
    return replace(
        ladder, verdict="missing", candidates=(), unknown=None, passed_over={}, limits={},
        response=CommandResponse.FOLLOWS,
    )  # fmt: skip


def suggest(study: Study, found: Diagnosis, report: Report) -> Suggestion | None:
    """Choose the experiment that settles what a diagnosis has left open."""
    from idloop.diagnosis.design.next_experiment import suggest_next

    return suggest_next(found, study.records, study.limits, duration=study.duration, seed=study.seed, progress=report)


def _rungs(found: Diagnosis, name: str) -> tuple[Rung, ...]:
    """What a diagnosis would add for an effect: both of a pair, one, or nothing that it has fitted."""
    from idloop.diagnosis.candidate import Rung

    if found.pair is not None and name in found.pair:
        return found.rungs
    one = next((c for c in found.candidates if c.name == name and c.model is not None), None)
    if one is None:
        return ()
    return (Rung(one, found.set if name in found.set else (name,)),)


def _with(study: Study, ladder: Ladder, rung: Rung, chosen_by: str) -> Ladder:
    added = rung.added
    if added.model is None:
        return ladder
    # What an effect takes the place of is no step of its own any more.
    steps = [s for s in ladder.steps if s.added is None or s.added.name != added.replaces or s.chosen_by == "user"]
    step = replace(_step(study, added.model, added), set=rung.set, p_value=added.p_value, chosen_by=chosen_by)
    return replace(ladder, steps=(*steps, step))


def _step(study: Study, model: Model, added: Candidate | None = None) -> Step:
    from idloop.diagnosis import Step
    from idloop.diagnosis.model_errors import model_errors

    return Step(
        added=added, model=model, train=model_errors(model, study.records),
        validation=model_errors(model, study.validation),
    )  # fmt: skip
