"""What is done to a model offline: diagnose, add, suggest. Runs in the worker and calls the library, no more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from idloop.spelling import joined_names

if TYPE_CHECKING:
    from idloop.diagnosis import Diagnosis, Ladder, Step
    from idloop.diagnosis.candidate import Rung
    from idloop.diagnosis.design.suggest import Limits
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.reporting.next_experiment import Next
    from idloop.reporting.residual_findings import ResidualFinding
    from idloop.validation.characteristic import Characteristic

Report = Callable[[float, str], None]


@dataclass(frozen=True)
class Study:
    """The data and how they are judged."""

    # What is fitted, and what the fits do not see
    records: tuple[Record, ...]
    validation: tuple[Record, ...] = ()
    level: float = 0.01  # family-wise error rate
    criterion: str = "auto"
    effects: tuple[str, ...] = ()  # that are looked for; all when empty
    seed: int = 0
    limits: Limits | None = None  # of a suggested experiment
    duration: float | None = None  # of a suggested experiment [s]
    minimum_improvement: float = 0.01  # part by which an effect must make errors on unseen samples smaller

    @property
    def options(self) -> tuple[str, ...]:
        """Words of the command line for how the data are judged; none for what is left as usual."""
        given = (
            ("--level", self.level, 0.01),
            ("--criterion", self.criterion, "auto"),
            ("--seed", self.seed, 0),
            ("--minimum-improvement", 100.0 * self.minimum_improvement, 1.0),
        )
        words = [(name, f"{value}") for name, value, usual in given if value != usual]
        words += [("--effects", name) for name in self.effects]
        return tuple(word for pair in words for word in pair)


@dataclass(frozen=True)
class Found:
    """A diagnosis without its fits, the ladder as it is now, what the effects look like, and the residual tests.

    `given` is the model before the fit with which a diagnosis begins, with its errors; None where that changed nothing.
    """

    diagnosis: Diagnosis
    ladder: Ladder
    pictures: dict[str, Characteristic]
    left: tuple[ResidualFinding, ...] = ()
    given: Step | None = None


def find_missing(study: Study, model: Model, ladder: Ladder | None, report: Report) -> Found:
    """Find out what a model lacks; without a ladder the fitted model becomes its first step."""
    from idloop.diagnosis import Ladder, diagnose
    from idloop.reporting.residual_findings import findings_on_records
    from idloop.reporting.workbench.assessment import draw_characteristics
    from idloop.reporting.workbench.state import model_version

    if ladder is None:
        report(0.0, f"first the model is fitted to {fitted_records(study)}")
    found = diagnose(
        model,
        study.records,
        study.validation,
        level=study.level,
        criterion=study.criterion,
        minimum_improvement=study.minimum_improvement,
        effects=study.effects or None,
        seed=study.seed,
        progress=lambda share, text: report(0.9 * share, text if share else ""),
    )
    pictures = draw_characteristics(
        found.candidates, study.records[0], lambda share, text: report(0.9 + 0.1 * share, text)
    )
    given = None
    if ladder is None:
        ladder = Ladder((_step(study, found.model),), criterion=found.criterion, level=study.level)
        if model_version(found.model) != model_version(model):
            given = _step(study, model)
    ladder = ladder.with_findings(found)
    return Found(found, ladder, pictures, tuple(findings_on_records(found.model, study.records)), given)


def fitted_records(study: Study) -> str:
    """Names of the recordings that are fitted."""
    return joined_names([record.name for record in study.records])


def add(
    study: Study, model: Model, ladder: Ladder | None, found: Diagnosis | None, name: str, report: Report
) -> Ladder:
    """Add an effect: as a diagnosis has fitted it with its intervals, else fitted now."""
    from idloop.diagnosis import add_effect

    if ladder is None:
        from idloop.diagnosis import Ladder
        from idloop.estimation import fit

        # What an effect is worth shows beside the same model fitted without it.
        begun = fit(model, study.records, study.criterion, lambda share, text: report(0.3 * share, text)).model
        ladder = Ladder((_step(study, begun),), level=study.level)
    rungs = () if found is None else _rungs(found, name)
    if not rungs:
        grown = add_effect(ladder, name, study.records, study.validation, seed=study.seed, progress=report)
        return replace(grown, steps=grown.steps[:-1]).with_step(grown.steps[-1])
    for number, rung in enumerate(rungs):
        report(number / len(rungs), f"errors with {rung.added.name}")
        ladder = ladder.with_rung(rung, study.records, study.validation)
    return ladder.undecided()


def suggest(study: Study, found: Diagnosis, report: Report) -> Next:
    """Choose the experiment that settles what a diagnosis has left open, or say why there is none."""
    from idloop.diagnosis.design.suggest import Limits
    from idloop.reporting.next_experiment import next_of_diagnosis

    options = {"duration": study.duration, "seed": study.seed, "progress": report}
    return next_of_diagnosis(found, study.records, study.limits or Limits(), options)


def _rungs(found: Diagnosis, name: str) -> tuple[Rung, ...]:
    """What a diagnosis would add for an effect: both of a pair, one, or nothing that it has fitted to its end.

    Of an effect that it has not chosen there is a trial fit, without standard errors.
    """
    from idloop.diagnosis.candidate import Rung

    if found.pair is not None and name in found.pair:
        return found.rungs
    one = next((c for c in found.candidates if c.name == name and c.model is not None and name in found.set), None)
    return () if one is None else (Rung(one, found.set),)


def _step(study: Study, model: Model) -> Step:
    from idloop.diagnosis import Step

    return Step(None, model).measured(model, study.records, study.validation)
