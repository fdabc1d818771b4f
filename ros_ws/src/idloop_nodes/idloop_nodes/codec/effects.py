"""Missing effects, and the ladder of those that were added, as diagnostic statuses.

A summary is its message: the worker writes it once from the library's result, and who receives it reads from it what he
needs. The whole result is in it as a document.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from idloop.documents import read_json
from idloop_nodes.codec.diagnostics import Level, Status
from idloop_nodes.codec.key_values import as_json, plus_minus, reading, text_or_empty

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Diagnosis, Ladder, Step, UnknownStructure
    from idloop.physics import Model

LEVELS = {"adequate": Level.OK, "missing": Level.WARN}
Windows = Sequence[tuple[int, int]]


@dataclass(frozen=True)
class _Summary:
    """Statuses of a message: one for all, then one for each effect or step."""

    statuses: tuple[Status, ...]

    @property
    def values(self) -> dict[str, str]:
        """Key values of the first status."""
        return self.statuses[0].values

    @property
    def line(self) -> str:
        """For a person."""
        return self.statuses[0].message

    @property
    def error(self) -> str:
        """Why there is no result, one line; empty when there is one."""
        return self.values["error"]

    @property
    def document(self) -> dict[str, Any] | None:
        """All of it as the command line writes it; None where there is no result."""
        return _mapping(self.values["document"])


class MissingSummary(_Summary):
    """What a diagnosis found: ``estimator/missing_effects``."""

    @property
    def verdict(self) -> str:
        """``missing``, ``adequate``, ``unknown_structure`` or ``not_excited``; empty without a diagnosis."""
        return self.values["verdict"]

    @property
    def set(self) -> tuple[str, ...]:
        """Effects that the data cannot tell from the best one, that one included."""
        return tuple(self.values["set"].split())

    @property
    def pair(self) -> tuple[str, ...]:
        """Two effects that show only together; messages of earlier versions have none."""
        return tuple(self.values.get("pair", "").split())

    @property
    def where(self) -> tuple[str, ...]:
        """Where the model fails, as lines."""
        return tuple(read_json(self.values["where"], "where"))

    @property
    def windows(self) -> tuple[tuple[int, ...], ...]:
        """First and last stamp of each stretch of data [ns]."""
        return tuple(tuple(map(int, one.split("-"))) for one in self.values["windows"].split())

    @property
    def fitted_models(self) -> dict[str, str]:
        """Models that were fitted with an effect, as texts of model files, by ``effect@site``."""
        found = {one.hardware_id: one.values.get("fitted_model", "") for one in self.statuses[1:]}
        return {name: text for name, text in found.items() if text}


class LadderSummary(_Summary):
    """All steps so far: ``estimator/ladder``."""

    @property
    def steps(self) -> tuple[Status, ...]:
        """A status for each step; the first one is the start."""
        return self.statuses[1:]

    @property
    def suggested_experiment(self) -> dict[str, Any] | None:
        """The next experiment, as `idloop suggest` writes it."""
        return _mapping(self.values["suggested_experiment"])

    @property
    def experiments(self) -> int:
        """Experiments whose data are in."""
        return int(self.values["experiments"])

    def failed(self, reason: str) -> LadderSummary:
        """The same ladder after an order that could not be carried out."""
        head = self.statuses[0]
        head = replace(head, message=reason, level=Level.WARN, values=head.values | {"error": reason})
        return LadderSummary((head, *self.steps))


def _mapping(text: str) -> dict[str, Any] | None:
    document = read_json(text, "document") if text else None
    if document is not None and not isinstance(document, dict):
        raise ValueError(f"{text[:40]!r} is no mapping")
    return document


def missing_to_statuses(node: str, found: Diagnosis, where: Sequence[str], windows: Windows) -> MissingSummary:
    """Return the message of a diagnosis; `where` the model fails, on which stretches of data [ns]."""
    values = {
        "verdict": found.verdict,
        "set": " ".join(found.set),
        "untestable": " ".join(found.untestable),
        "findings": _lines(found.gate.findings),
        "where": _lines(where),
        "windows": " ".join(f"{start}-{stop}" for start, stop in windows),
        "document": as_json(found.to_dict()),
        "pair": " ".join(found.pair or ()),
    }
    if found.unknown is not None:
        values |= _unknown(found.unknown)
    severity = LEVELS.get(found.verdict, Level.WARN)
    head = _missing_head(node, found.model, _missing_line(found), severity, found.criterion, found.level, values)
    effects = [
        Status(
            f"{node}: {one.name}",
            _effect_line(one),
            Level.WARN if one.name in found.set else Level.OK,
            _effect(one, "" if one.model is None else one.model.to_yaml()),
            one.name,
        )
        for one in found.candidates
    ]
    return MissingSummary((head, *effects))


def no_diagnosis(node: str, model: Model, criterion: str, level: float, reason: str) -> MissingSummary:
    """Return the message where there is no diagnosis of a model, and why."""
    return MissingSummary((_missing_head(node, model, reason, Level.WARN, criterion, level, {"error": reason}),))


def _missing_head(
    node: str, model: Model, line: str, severity: Level, criterion: str, level: float, values: Mapping[str, str]
) -> Status:
    known = {"model": model.name, "effects": " ".join(model.effect_names), "criterion": criterion}
    empty = dict.fromkeys(("verdict", "set", "untestable", "windows", "document", "error", "pair"), "")
    empty |= {"findings": "[]", "where": "[]", "level": repr(float(level))}
    return Status(f"{node}: missing effects", line, severity, known | empty | dict(values), model.name)


def _missing_line(found: Diagnosis) -> str:
    """The verdict for a person."""
    if found.verdict == "missing" and found.candidates:
        best = found.candidates[0]
        if found.pair:
            return f"only together: {' and '.join(found.pair)} are missing ({_effect_line(best)})"
        ties = [name for name in found.set if name != best.name]
        tied = f"; this data cannot tell it from {', '.join(ties)}" if ties else ""
        return f"{best.name} is missing ({_effect_line(best)}){tied}"
    if found.verdict == "adequate":
        return "nothing significant is missing"
    if found.verdict == "unknown_structure":
        return found.unknown.text if found.unknown else "something is missing that is not in the catalogue"
    if found.verdict == "not_excited":
        return f"nothing significant is missing, but this data cannot show {', '.join(found.untestable)}"
    return found.verdict


def _effect_line(one: Candidate) -> str:
    """Evidence and parameters of an effect for a person."""
    parts = []
    if math.isfinite(one.p_value):
        parts.append(f"p {one.p_value:.2g}" if one.p_value >= 1e-3 else "p < 0.001")
    parts.append(f"explains {100.0 * one.explains:.0f} %")
    parts += [f"{name} {estimate_text(entry)}" for name, entry in one.parameters.items()]
    return ", ".join(parts)


def estimate_text(entry: Mapping[str, Any]) -> str:
    """Return a parameter of an effect with its 95 % interval: ``0.121 ± 0.002 V``."""
    return f"{entry['value']:.4g}{plus_minus(entry.get('stderr'))} {entry.get('unit', '')}".strip()


def _effect(one: Candidate, fitted_model: str = "") -> dict[str, str]:
    values = {
        "effect": one.effect,
        "at": one.at,
        "testable": one.testable,
        "p_value": text_or_empty(one.p_value),
        "explains": repr(float(one.explains)),
        "gain": text_or_empty(one.gain),
        "replaces": one.replaces or "",
        "why": one.why,
        "text": one.text,
        "fitted_model": fitted_model,
    }
    for name, entry in one.parameters.items():
        values[f"parameter/{name}"] = repr(float(entry["value"]))
        values[f"stderr/{name}"] = text_or_empty(entry.get("stderr"))
        values[f"unit/{name}"] = str(entry.get("unit", ""))
    return values


def _unknown(unknown: UnknownStructure) -> dict[str, str]:
    """What no effect of the catalogue explains: the remaining force over a variable, with its band."""
    names = ("variable", "unit", "force_unit", "text")
    curves = {name: getattr(unknown, name) for name in ("at", "force", "band")}
    return {
        **{f"unknown/{name}": getattr(unknown, name) for name in names},
        **{f"unknown/{name}": " ".join(repr(float(value)) for value in curve) for name, curve in curves.items()},
        "unknown/share": repr(float(unknown.share)),
    }


def ladder_to_statuses(
    node: str, ladder: Ladder, suggested: Mapping[str, Any] | None, experiments: int
) -> LadderSummary:
    """Return the message of a ladder with the next experiment; `experiments`: those whose data are in."""
    # As a ladder names it; what its simulation needs is sent once.
    named = None if suggested is None else {name: part for name, part in suggested.items() if name != "rivals"}
    values = {
        "model": ladder.model.name,
        "verdict": ladder.verdict,
        "untestable": " ".join(ladder.untestable),
        "suggested_experiment": "" if suggested is None else json.dumps(suggested, ensure_ascii=False),
        "experiments": str(experiments),
        "document": as_json({**ladder.to_dict(), "suggested_experiment": named}),
        "error": "",
    }
    what, fit = " + ".join(["start", *ladder.added]), _fit_text(ladder.steps[-1])
    line = f"{what}: FIT {fit} on data not used in the fit" if fit else what
    head = Status(f"{node}: ladder", line, Level.OK, values, ladder.model.name)
    return LadderSummary((head, *(_step(node, number, step) for number, step in enumerate(ladder.steps))))


def _step(node: str, number: int, step: Step) -> Status:
    values = {
        "set": " ".join(step.set),
        "step_p_value": text_or_empty(step.p_value),
        "chosen_by": "" if step.added is None else step.chosen_by,
        "model": step.model.to_yaml(),
    }
    for use in ("train", "validation"):
        errors: Mapping[str, Any] = getattr(step, use)
        for measure in ("nrmse", "fit", "rmse"):
            values |= {f"{use}/{measure}/{name}": repr(float(x)) for name, x in (errors.get(measure) or {}).items()}
        values[f"{use}/force"] = text_or_empty(errors.get("force"))
    name, effect = "start", ""
    if step.added is not None:
        name, effect = f"+ {step.added.name}", step.added.name
        values |= _effect(step.added)
    fit = _fit_text(step)
    return Status(f"{node}: step {number}", f"{name}: FIT {fit}" if fit else name, Level.OK, values, effect)


def _fit_text(step: Step) -> str:
    """FIT of every output on data that the fit never saw, for a person."""
    return ", ".join(f"{name} {value:.2f} %" for name, value in step.validation.get("fit", {}).items())


def _lines(lines: Sequence[str]) -> str:
    return json.dumps(list(lines), ensure_ascii=False)


def missing_from_statuses(statuses: Sequence[Status]) -> MissingSummary:
    """Return the message of a diagnosis as it was received; CdrError when it cannot be read."""
    with reading("estimator/missing_effects", statuses):
        found = MissingSummary(tuple(statuses))
        _ = found.error, found.verdict, found.set, found.where, found.windows, found.document
        return found


def ladder_from_statuses(statuses: Sequence[Status]) -> LadderSummary:
    """Return the message of a ladder as it was received; CdrError when it cannot be read."""
    with reading("estimator/ladder", statuses):
        found = LadderSummary(tuple(statuses))
        _ = found.error, found.suggested_experiment, found.experiments, found.document
        return found
