"""The ladder: a model that grows by one effect at a time until nothing significant is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.diagnosis.candidate import Candidate, Rung
from idloop.diagnosis.evidence.detection_limit import DetectionLimit
from idloop.diagnosis.model_errors import model_errors
from idloop.diagnosis.residual_curves.unknown_structure import UnknownStructure
from idloop.diagnosis.screening.command_response import CommandResponse
from idloop.diagnosis.search.step import ADEQUATE
from idloop.diagnosis.worsened import Worsened, worsened
from idloop.errors import InputError
from idloop.physics.model import Model
from idloop.physics.model_file import from_text
from idloop.records import Record

if TYPE_CHECKING:
    from idloop.diagnosis.diagnosis import Diagnosis

SCHEMA = "idloop/refine/1"


@dataclass(frozen=True)
class Step:
    """One step of a ladder.

    Attributes
    ----------
    added : Candidate or None
        The effect that was added; None for the start.
    set : tuple of str
        Effects that tie with it, itself included.
    p_value : float or None
    chosen_by : {"diagnosis", "user"}
    model : Model
        Fitted with it.
    train, validation : dict
        Errors: ``nrmse``, ``fit`` [%], ``rmse`` by output, ``force`` (relative), and per record.
    """

    added: Candidate | None
    model: Model
    set: tuple[str, ...] = ()
    p_value: float | None = None
    chosen_by: str = "diagnosis"
    train: dict[str, Any] = field(default_factory=dict)
    validation: dict[str, Any] = field(default_factory=dict)

    def measured(self, model: Model, records: Sequence[Record], validation: Sequence[Record]) -> Step:
        """The step with a model and its errors."""
        return replace(
            self, model=model, train=model_errors(model, records), validation=model_errors(model, validation)
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; the model as text."""
        keys = ("effect", "at", "parameters", "explains", "replaces", "number", "text")
        return {
            "added": None if self.added is None else {name: getattr(self.added, name) for name in keys},
            "p_value": self.p_value,
            "set": list(self.set),
            "chosen_by": self.chosen_by,
            "train": self.train,
            "validation": self.validation,
            "model": self.model.to_yaml(),
        }


@dataclass(frozen=True)
class Ladder:
    """Steps from the start model to the last one, and what is left.

    Attributes
    ----------
    steps : tuple of Step
        The first is the start.
    verdict : {"adequate", "unknown_structure", "not_excited", "missing"}
        ``missing`` while the ladder was stopped before its end.
    candidates : tuple of Candidate
        What the last step evaluated, best first.
    untestable : tuple of str
    findings : tuple of str
        What the data can show.
    limits : mapping of str to DetectionLimit
        Detection limits of what was not found, by effect and site.
    unknown : UnknownStructure or None
    suggested_experiment : dict or None
    criterion : str
    level : float
    passed_over : mapping of str to str
        Effects that were significant on the fitted data in the end and were not added, and why.
    response : CommandResponse
        How the motion follows the command by the last model.
    """

    steps: tuple[Step, ...]
    verdict: str = "missing"
    candidates: tuple[Candidate, ...] = ()
    untestable: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    unknown: UnknownStructure | None = None
    suggested_experiment: dict[str, Any] | None = None
    criterion: str = "auto"
    level: float = 0.01
    passed_over: Mapping[str, str] = field(default_factory=dict)
    limits: Mapping[str, DetectionLimit] = field(default_factory=dict)
    response: CommandResponse = CommandResponse.FOLLOWS

    @property
    def model(self) -> Model:
        """Model of the last step."""
        return self.steps[-1].model

    @property
    def added(self) -> tuple[str, ...]:
        """Names of the effects that were added."""
        return tuple(step.added.name for step in self.steps if step.added is not None)

    @property
    def worsened(self) -> list[Worsened]:
        """Steps after which the free run is worse; judged on validation records where there are any."""
        return self._worsened(*self.steps)

    @property
    def still_worsened(self) -> list[Worsened]:
        """Those of `worsened` whose free run is still worse in the last model than before them."""
        found, names = [], {one.name for one in self.worsened}
        for before, step in zip(self.steps, self.steps[1:], strict=False):
            if step.added is not None and step.added.name in names:
                found += self._worsened(before, replace(self.steps[-1], added=step.added))
        return found

    def _worsened(self, *steps: Step) -> list[Worsened]:
        unseen = bool(self.steps[0].validation)
        names = ["" if step.added is None else step.added.name for step in steps]
        return worsened(names, [step.validation if unseen else step.train for step in steps], unseen=unseen)

    def rivals(self, step: Step) -> tuple[str, ...]:
        """Effects that tie with that of a step and that the model does not have."""
        if step.added is None:
            return ()
        return tuple(name for name in step.set if name != step.added.name and name not in self.model.effect_names)

    def replaced(self, step: Step) -> str:
        """What the effect of a step has replaced, in words; empty where it was added beside the others.

        A plain effect that the ladder itself had added is no step any more once one that contains it has replaced it.
        """
        name = None if step.added is None else step.added.replaces
        if step.added is None or not name:
            return ""
        if name == step.added.name:
            return "in its fuller form, in place of the plain one"
        if name in self.steps[0].model.effect_names:
            return f"in place of {name} of the start model, which it contains"
        if name in self.added:
            return f"in place of {name}, which it contains"
        return f"it contains {name}, which was added before it and is no step of its own any more"

    def with_findings(self, found: Diagnosis) -> Ladder:
        """The ladder with what a diagnosis of its last model has found; its candidates without their fits."""
        return replace(
            self,
            criterion=found.criterion,
            verdict=found.verdict,
            candidates=tuple(replace(one, model=None) for one in found.candidates),
            untestable=found.untestable,
            findings=found.gate.findings,
            unknown=found.unknown,
            passed_over=found.passed_over,
            limits=found.gate.limits,
            response=found.response,
        )

    def with_rung(self, rung: Rung, records: Sequence[Record], validation: Sequence[Record]) -> Ladder:
        """The ladder with what a diagnosis would add; as it is where that was not fitted."""
        added = rung.added
        if added.model is None:
            return self
        return self.with_step(
            Step(added, added.model, rung.set, added.p_value).measured(added.model, records, validation)
        )

    def with_step(self, step: Step) -> Ladder:
        """The ladder with one more step, in place of that whose effect the new one replaces."""
        gone = None if step.added is None else step.added.replaces
        kept = [one for one in self.steps if one.added is None or one.added.name != gone or one.chosen_by == "user"]
        return replace(self, steps=(*kept, step))

    def undecided(self) -> Ladder:
        """The ladder as long as nobody has diagnosed its last model."""
        return replace(
            self, verdict="missing", candidates=(), unknown=None, suggested_experiment=None, passed_over={}, limits={},
            response=CommandResponse.FOLLOWS,
        )  # fmt: skip

    def merged_with(self, other: Ladder) -> Ladder:
        """The ladder with the verdict of a second view of its last model, which added nothing: the stricter of both."""
        shown = {one.name for one in other.candidates} - set(other.untestable)
        # The other view decides about candidates that this one cannot show.
        there = {one.name: one for one in other.candidates}
        seen = [there.pop(one.name, one) if one.testable == "no" else one for one in self.candidates]
        names = {one.name for one in seen}
        return replace(
            self,
            verdict=self.verdict if self.verdict != ADEQUATE else other.verdict,
            candidates=(*seen, *(one for name, one in there.items() if name not in names)),
            untestable=tuple(name for name in self.untestable if name not in shown),
            findings=tuple(dict.fromkeys((*self.findings, *other.findings))),
            unknown=self.unknown or other.unknown,
            passed_over={**other.passed_over, **self.passed_over},
            limits={**other.limits, **self.limits},
            response=other.response,
        )

    def undo(self) -> Ladder:
        """The ladder without its last step.

        Raises
        ------
        InputError
            Nothing was added yet.
        """
        if len(self.steps) < 2:
            raise InputError("nothing to undo: no effect was added yet")
        return replace(self.undecided(), steps=self.steps[:-1])

    def to_dict(self) -> dict[str, Any]:
        """The document of schema ``idloop/refine/1``."""
        return {
            "schema": SCHEMA,
            "criterion": self.criterion,
            "level": self.level,
            "ladder": [step.to_dict() for step in self.steps],
            "verdict": self.verdict,
            "candidates": [c.to_dict() for c in self.candidates],
            "untestable": list(self.untestable),
            "findings": list(self.findings),
            "unknown": None if self.unknown is None else self.unknown.to_dict(),
            "suggested_experiment": self.suggested_experiment,
            "passed_over": dict(self.passed_over),
            "shows_from": {name: limit.to_dict() for name, limit in self.limits.items()},
            "worsened": [one.to_dict() for one in self.worsened],
            "response": self.response.value,
        }

    @classmethod
    def from_dict(cls, document: dict[str, Any], folder: Path | None = None) -> Ladder:
        """Read what `to_dict` wrote.

        Parameters
        ----------
        document : dict
        folder : Path, optional
            Where the models' own effects lie.

        Raises
        ------
        InputError
            Not such a document.
        """
        if document.get("schema") != SCHEMA:
            raise InputError(f"this is no ladder: its schema is {document.get('schema')!r}, not {SCHEMA!r}")
        steps = []
        for entry in document["ladder"]:
            model, added = from_text(entry["model"], folder), entry["added"]
            if added is not None:
                added = replace(Candidate.from_dict({**added, "p_value": entry.get("p_value") or 1.0}), model=model)
            own = {name: entry[name] for name in ("p_value", "chosen_by", "train", "validation") if name in entry}
            steps.append(Step(added, model, tuple(entry.get("set", ())), **own))
        return cls(
            steps=tuple(steps),
            verdict=document["verdict"],
            candidates=tuple(Candidate.from_dict(c) for c in document.get("candidates", ())),
            untestable=tuple(document.get("untestable", ())),
            findings=tuple(document.get("findings", ())),
            unknown=None if document.get("unknown") is None else UnknownStructure.from_dict(document["unknown"]),
            suggested_experiment=document.get("suggested_experiment"),
            criterion=document.get("criterion", "auto"),
            level=document.get("level", 0.01),
            passed_over=document.get("passed_over", {}),
            limits={name: DetectionLimit.from_dict(one) for name, one in document.get("shows_from", {}).items()},
            response=CommandResponse(document.get("response", CommandResponse.FOLLOWS)),
        )
