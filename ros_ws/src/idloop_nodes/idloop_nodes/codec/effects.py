"""Missing effects, and the ladder of those that were added, as diagnostic statuses and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from idloop_nodes.codec.diagnostics import Level, Status
from idloop_nodes.codec.key_values import from_values, number_or_none, plus_minus, reading, text_or_empty, to_values

LEVELS = {"adequate": Level.OK, "missing": Level.WARN}


@dataclass(frozen=True)
class Estimate:
    """Value of one parameter of an effect, with standard error (or None) and unit."""

    value: float
    stderr: float | None = None
    unit: str = ""

    @property
    def text(self) -> str:
        """For a person, with the 95 % interval: ``0.121 ± 0.002 V``."""
        return f"{self.value:.4g}{plus_minus(self.stderr)} {self.unit}".strip()


@dataclass(frozen=True)
class EffectSummary:
    """One effect that may be missing."""

    # Effect and site
    effect: str
    at: str
    testable: str = "yes"  # ``yes``, ``weak`` or ``no``: what the data can show of it
    p_value: float | None = None  # family-wise; None when it was not tested
    explains: float = 0.0  # share of the unexplained error that it explains, 0 to 1
    gain: float | None = None  # log-likelihood gained; None when it was only screened
    parameters: dict[str, Estimate] = field(default_factory=dict)  # by the parameter's name in the effect
    replaces: str = ""  # effect of the model whose place it takes; empty when none
    # Why it is testable or resembles this one; its physics in a sentence
    why: str = ""
    text: str = ""
    # The model that was fitted with it, as the text of a model file; empty when it was only screened
    fitted_model: str = field(default="", metadata={"added": True})

    @property
    def name(self) -> str:
        """``dead_zone@input``."""
        return f"{self.effect}@{self.at}"

    @property
    def line(self) -> str:
        """Evidence and parameters for a person."""
        parts = [] if self.p_value is None else [f"p {self.p_value:.2g}" if self.p_value >= 1e-3 else "p < 0.001"]
        parts.append(f"explains {100.0 * self.explains:.0f} %")
        parts += [f"{name} {one.text}" for name, one in self.parameters.items()]
        return ", ".join(parts)


@dataclass(frozen=True)
class UnknownSummary:
    """Structure that no effect of the catalogue explains: the remaining force over a variable, with its band."""

    variable: str
    unit: str
    force_unit: str
    at: tuple[float, ...]
    force: tuple[float, ...]
    band: tuple[float, ...]
    share: float
    text: str


@dataclass(frozen=True)
class MissingSummary:
    """What a diagnosis found."""

    model: str  # name of the model
    effects: tuple[str, ...] = ()  # effects that it has
    verdict: str = ""  # ``missing``, ``adequate``, ``unknown_structure`` or ``not_excited``
    candidates: tuple[EffectSummary, ...] = ()  # best first
    set: tuple[str, ...] = ()  # effects that the data cannot tell from the best one, that one included
    untestable: tuple[str, ...] = ()  # effects of which the data can show nothing
    # What the data can show; where the model fails
    findings: tuple[str, ...] = field(default=(), metadata={"lines": True})
    where: tuple[str, ...] = field(default=(), metadata={"lines": True})
    unknown: UnknownSummary | None = None
    criterion: str = ""
    level: float = 0.01  # family-wise error rate
    windows: tuple[tuple[int, int], ...] = ()  # first and last stamp of each stretch of data in nanoseconds
    document: str = ""  # all of it as `idloop diagnose` writes it (JSON, schema idloop/diagnose/1)
    error: str = ""  # why there is no diagnosis, one line; empty when there is one
    # Two effects that show only together; empty where one alone is missing, or none
    pair: tuple[str, ...] = field(default=(), metadata={"added": True})

    @property
    def line(self) -> str:
        """The verdict for a person."""
        if self.error:
            return self.error
        if self.verdict == "missing" and self.candidates:
            best = self.candidates[0]
            ties = [name for name in self.set if name != best.name]
            tied = f"; this data cannot tell it from {', '.join(ties)}" if ties else ""
            if self.pair:
                return f"only together: {' and '.join(self.pair)} are missing ({best.line})"
            return f"{best.name} is missing ({best.line}){tied}"
        if self.verdict == "adequate":
            return "nothing significant is missing"
        if self.verdict == "unknown_structure":
            return self.unknown.text if self.unknown else "something is missing that is not in the catalogue"
        if self.verdict == "not_excited":
            return f"nothing significant is missing, but this data cannot show {', '.join(self.untestable)}"
        return self.verdict


def missing_to_statuses(node: str, summary: MissingSummary) -> list[Status]:
    """Return the statuses of ``estimator/missing_effects``."""
    values = to_values(summary)
    if summary.unknown is not None:
        values |= to_values(summary.unknown, "unknown/")
    level = Level.WARN if summary.error else LEVELS.get(summary.verdict, Level.WARN)
    head = Status(f"{node}: missing effects", summary.line, level, values, summary.model)
    return [head, *(_effect_to_status(node, one, tied=one.name in summary.set) for one in summary.candidates)]


def missing_from_statuses(statuses: Sequence[Status]) -> MissingSummary:
    """Return the summary that `missing_to_statuses` wrote; CdrError when it cannot be read."""
    with reading("estimator/missing_effects", statuses) as values:
        known = "unknown/variable" in values
        unknown = from_values(UnknownSummary, values, "unknown/") if known else None
        candidates = tuple(effect_from_values(one.values) for one in statuses[1:])
        return from_values(MissingSummary, values, candidates=candidates, unknown=unknown)


def _effect_to_status(node: str, one: EffectSummary, *, tied: bool) -> Status:
    level = Level.WARN if tied else Level.OK
    return Status(f"{node}: {one.name}", one.line, level, effect_to_values(one), one.name)


def effect_to_values(one: EffectSummary) -> dict[str, str]:
    """Return the key values of one effect."""
    values = to_values(one)
    for name, estimate in one.parameters.items():
        values[f"parameter/{name}"] = repr(float(estimate.value))
        values[f"stderr/{name}"] = text_or_empty(estimate.stderr)
        values[f"unit/{name}"] = estimate.unit
    return values


def effect_from_values(values: dict[str, str]) -> EffectSummary:
    """Return the effect that `effect_to_values` wrote; KeyError or ValueError when it did not."""
    names = [key.removeprefix("parameter/") for key in values if key.startswith("parameter/")]
    parameters = {
        name: Estimate(
            float(values[f"parameter/{name}"]), number_or_none(values[f"stderr/{name}"]), values[f"unit/{name}"]
        )
        for name in names
    }
    return from_values(EffectSummary, values, parameters=parameters)


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
