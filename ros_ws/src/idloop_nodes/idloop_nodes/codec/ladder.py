"""The ladder as diagnostic statuses and back: one status for the whole, one for each step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from idloop_nodes.codec.diagnostics import Level, Status
from idloop_nodes.codec.effects import EffectSummary, effect_from_values, effect_to_values
from idloop_nodes.codec.key_values import from_values, reading, to_values


@dataclass(frozen=True)
class Measures:
    """Errors of one model on one kind of data."""

    # By output: error over spread, FIT in percent, error in the output's unit
    nrmse: dict[str, float] = field(default_factory=dict)
    fit: dict[str, float] = field(default_factory=dict)
    rmse: dict[str, float] = field(default_factory=dict)
    force: float | None = None  # relative error of the drive force, where it can be compared

    @property
    def line(self) -> str:
        """FIT of every output for a person."""
        return ", ".join(f"{name} {value:.2f} %" for name, value in self.fit.items())


@dataclass(frozen=True)
class StepSummary:
    """One step: what was added, on what evidence, and what it did to the error."""

    added: EffectSummary | None = None  # None for the start
    set: tuple[str, ...] = ()  # effects that the data could not tell from the one added, that one included
    p_value: float | None = field(default=None, metadata={"key": "step_p_value"})
    chosen_by: str = ""  # ``diagnosis`` or ``user``; empty for the start
    # On the data of the fit, and on data that it never saw
    train: Measures = field(default_factory=Measures)
    validation: Measures = field(default_factory=Measures)
    model: str = ""  # the model of this step as a model file


@dataclass(frozen=True)
class LadderSummary:
    """All steps so far."""

    model: str  # name of the model
    steps: tuple[StepSummary, ...] = ()  # the first one is the start
    verdict: str = ""  # as of the newest diagnosis
    untestable: tuple[str, ...] = ()
    suggested_experiment: dict[str, Any] | None = None  # the next experiment, as `idloop suggest` writes it
    experiments: int = 0  # experiments whose data are in
    # All of it as `idloop refine` writes it (JSON, schema idloop/refine/1): the ladder can be climbed on offline
    document: str = ""
    error: str = ""  # why the last order could not be carried out, one line; empty when it was

    @property
    def line(self) -> str:
        """The newest step for a person."""
        if self.error:
            return self.error
        if not self.steps:
            return "no step yet"
        added = [step.added.name for step in self.steps if step.added is not None]
        what = " + ".join(["start", *added])
        fit = self.steps[-1].validation.line
        return f"{what}: FIT {fit} on data not used in the fit" if fit else what


def ladder_to_statuses(node: str, summary: LadderSummary) -> list[Status]:
    """Return the statuses of ``estimator/ladder``."""
    level = Level.WARN if summary.error else Level.OK
    head = Status(f"{node}: ladder", summary.line, level, to_values(summary), summary.model)
    return [head, *(_step_to_status(node, number, step) for number, step in enumerate(summary.steps))]


def _step_to_status(node: str, number: int, step: StepSummary) -> Status:
    values = to_values(step) | to_values(step.train, "train/") | to_values(step.validation, "validation/")
    name, hardware = "start", ""
    if step.added is not None:
        name, hardware = f"+ {step.added.name}", step.added.name
        values |= effect_to_values(step.added)
    message = f"{name}: FIT {step.validation.line}" if step.validation.fit else name
    return Status(f"{node}: step {number}", message, Level.OK, values, hardware)


def ladder_from_statuses(statuses: Sequence[Status]) -> LadderSummary:
    """Return the summary that `ladder_to_statuses` wrote; CdrError when it cannot be read."""
    with reading("estimator/ladder", statuses) as values:
        return from_values(LadderSummary, values, steps=tuple(_step_from_values(one.values) for one in statuses[1:]))


def _step_from_values(values: dict[str, str]) -> StepSummary:
    return from_values(
        StepSummary,
        values,
        added=effect_from_values(values) if "effect" in values else None,
        train=from_values(Measures, values, "train/"),
        validation=from_values(Measures, values, "validation/"),
    )
