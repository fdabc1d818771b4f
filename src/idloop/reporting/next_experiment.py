"""What is to be done next: the experiment that settles what is open, a check by hand, or nothing; words and file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.diagnosis.design.expected_outcome import DECISIVE, describe_signal, lead_text
from idloop.diagnosis.equivalence.equivalent_effects import (
    EquivalentEffects,
    equivalent_effects_of_ladder,
    equivalent_rivals,
    without_equivalents,
)
from idloop.reporting.experiment_rows import reach, rows_of
from idloop.reporting.text.blocks import Block, Table
from idloop.reporting.verdicts import undetectable

if TYPE_CHECKING:
    from idloop.diagnosis import Diagnosis, Ladder, Step
    from idloop.diagnosis.design.suggest import Limits, Suggestion
    from idloop.physics import Model
    from idloop.records import Record

SCHEMA = "idloop/next/1"
# Expected lead in log-likelihood below which an experiment says nothing at all.
_NOTHING = 1.0


@dataclass(frozen=True)
class Next:
    """What is to be done next."""

    suggestion: Suggestion | None = None  # an experiment that is worth running
    twins: tuple[EquivalentEffects, ...] = ()  # what no experiment settles
    # Effects that the data cannot show, and why; those that the experiment would show included
    undetectable: Mapping[str, str] = field(default_factory=dict)
    reason: str = ""  # why there is no experiment, in words; empty where there is one
    futile: bool = False  # the best experiment is expected to say nothing
    lead: str = ""  # what was found before; empty where that is known

    def blocks(self) -> Iterator[Block]:
        """Yield what was found before, the experiment with what each rival would show, or why there is none."""
        if self.lead:
            yield self.lead
        for group in self.twins:
            yield from group.lines
        if self.suggestion is not None:
            yield from experiment_blocks(self.suggestion.to_dict())
        elif self.reason:
            yield self.reason

    def to_dict(self) -> dict[str, Any]:
        """What goes beside the experiment in JSON."""
        return {
            "one_equation": [group.to_dict() for group in self.twins],
            "untestable": dict(self.undetectable),
            "reason": self.reason,
        }


def next_of_ladder(ladder: Ladder, records: Sequence[Record], limits: Limits, options: Mapping[str, Any]) -> Next:
    """What settles what a ladder has left open.

    `options`: further arguments of `idloop.diagnosis.design.next_experiment.suggest_next`.
    """
    from idloop.diagnosis.design.next_experiment import suggest_next

    twins = equivalent_effects_of_ladder(ladder)
    steps = [replace(step, set=without_equivalents(_first(ladder, step), twins)) for step in ladder.steps]
    open_ = undetectable(ladder)
    asked = replace(ladder, steps=tuple(steps), untestable=tuple(open_))
    return _judged(suggest_next(asked, records, limits, **options), twins, open_, ladder.verdict)


def next_of_diagnosis(found: Diagnosis, records: Sequence[Record], limits: Limits, options: Mapping[str, Any]) -> Next:
    """What settles what a diagnosis has left open; arguments as those of `next_of_ladder`."""
    from idloop.diagnosis.design.next_experiment import suggest_next

    twins = found.equivalent_effects
    open_ = {name: found.gate.why.get(name, "") for name in found.untestable if name not in found.set}
    asked = replace(found, set=without_equivalents(found.set, twins))
    best = found.best
    if (
        best is not None
        and best.model is not None
        and len(asked.set) == 1
        and all(len(one.set) < 2 for one in asked.rungs)
    ):
        # What else there is to ask is asked of the model that has what is missing.
        left = {name: answer for name, answer in found.gate.testable.items() if name not in found.set}
        asked = replace(asked, model=best.model, gate=replace(found.gate, testable=left))
    answer = _judged(suggest_next(asked, records, limits, **options), twins, open_, found.verdict)
    if best is None:
        return answer
    lacking = f"{best.name} is" if found.pair is None else f"{' and '.join(found.pair)} are"
    return replace(answer, lead=f"{lacking} missing, which idloop refine adds; what else is open:")


def next_of_models(
    models: Sequence[Model],
    records: Sequence[Record],
    limits: Limits,
    criterion: str,
    options: Mapping[str, Any],
    *,
    fitted: bool,
) -> Next:
    """What separates rival models; those that are one equation count once where they are fitted."""
    from idloop.diagnosis.design.suggest import suggest

    kept, twins = equivalent_rivals(models) if fitted else (tuple(range(len(models))), None)
    groups = () if twins is None else (twins,)
    if len(kept) < 2:
        return Next(twins=groups)
    found = suggest([models[i] for i in kept], records, limits, criterion=criterion, **options)
    return _judged(found, groups, {}, "")


def _first(ladder: Ladder, step: Step) -> tuple[str, ...]:
    """The tied effects, that of the model before those that would do in its place."""
    if step.added is None:
        return step.set
    return (step.added.name, *ladder.rivals(step))


def _judged(
    found: Suggestion | None, twins: Sequence[EquivalentEffects], open_: Mapping[str, str], verdict: str
) -> Next:
    """The answer; an experiment that is expected to say nothing is none."""
    if found is not None and any(outcome.in_favour >= _NOTHING for outcome in found.outcomes):
        return Next(found, tuple(twins), open_)
    reason = found.text if found is not None else _reason(open_, verdict, tied=bool(twins))
    return Next(None, tuple(twins), open_, reason, futile=found is not None)


def _reason(open_: Mapping[str, str], verdict: str, *, tied: bool) -> str:
    """Why there is nothing to run."""
    ties = "no others tie" if tied else "no two effects tie"
    if open_:
        listing = "".join(f"\n  {name}{f': {why}' if why else ''}" for name, why in open_.items())
        return (
            f"{ties}, and within the limits of this data no experiment would show the effects below; some may show "
            f"with more of --max-command, --position-range or --max-velocity:{listing}"
        )
    if verdict == "unknown_structure":
        return f"{ties}; what is left is structured, and the data show every effect of the catalogue: none is it"
    return f"nothing {'else ' if tied else ''}is open: {ties}, and the data would show every other one"


def experiment_blocks(suggested: Mapping[str, Any]) -> Iterator[Block]:
    """Yield what an experiment is expected to decide, and a row for each rival.

    `suggested`: as `idloop.diagnosis.design.suggest.Suggestion.to_dict` writes it, or what is left of it in a ladder.
    """
    if suggested.get("signal"):
        signal = describe_signal(suggested["signal"], suggested["adds_to"], suggested.get("unit", ""))
        yield f"next experiment: {signal}"
    yield suggested["text"]
    if suggested.get("outcomes"):
        yield _outcomes(suggested["outcomes"])
        yield f"(lead: expected difference in log-likelihood from the other, refitted; {DECISIVE:.0f} or more decides)"


def _outcomes(outcomes: Sequence[Mapping[str, Any]]) -> Table:
    rows = []
    for one in outcomes:
        errors: Mapping[str, Mapping[str, Any]] | None = one["errors"].get(one["closest"])
        shown = "none: it contains this one"
        if errors:
            name, worst = max(errors.items(), key=lambda item: item[1]["value"] / max(item[1]["noise"], 1e-300))
            shown = f"{worst['value']:.3g} {worst['unit']} of {name}, noise {worst['noise']:.2g}"
        decides = "yes" if errors and one["in_favour"] >= DECISIVE else "no"
        rows.append((one["rival"], one["closest"], shown, lead_text(one["in_favour"]), decides))
    return Table.of(("if this is right", "closest other", "largest difference, RMS", "lead", "decides"), rows)


def predicted_motion(suggestion: Suggestion) -> list[dict[str, Any]]:
    """Range of what is sent in and of every output over all rivals, with its limits.

    Returns: plain values for JSON: ``name``, ``unit``, ``low`` and ``high``; ``limits``, the lower first, empty where
    there are none.
    """
    found = []
    for row in rows_of(suggestion):
        if row.kind == "difference":
            continue
        name, _, unit = row.label.rpartition(" [")
        low, high = reach(row.curves)
        found.append({"name": name, "unit": unit.rstrip("]"), "low": low, "high": high, "limits": list(row.bounds)})
    return found


def next_document(suggestion: Suggestion) -> dict[str, Any]:
    """Plain values for JSON: what ``ladder.json`` says of it, and what its simulation needs."""
    return {
        "schema": SCHEMA,
        **suggestion.to_dict(),
        "controller": suggestion.controller,
        "sample_time": suggestion.sample_time,
        "noise": list(suggestion.noise),
        "against_first": suggestion.against_first,
        "rivals": [{"label": label, "model": model.to_yaml()} for label, model in suggestion.rivals],
    }


def read_next(document: dict[str, Any], folder: Path | None = None) -> Suggestion:
    """Read what `next_document` wrote; `folder`: where the models' own effects lie."""
    from idloop.diagnosis.design.suggest import Limits, Outcome, Suggestion
    from idloop.physics.model_file import from_text

    limits = document["limits"]
    reach = limits.get("position")
    return Suggestion(
        signal=document["signal"],
        adds_to=document["adds_to"],
        duration=document["duration"],
        discrimination=document["discrimination"],
        outcomes=tuple(Outcome(**outcome) for outcome in document["outcomes"]),
        text=document["text"],
        limits=Limits(**{**limits, "position": None if reach is None else (float(reach[0]), float(reach[1]))}),
        start=document["start"],
        controller=document["controller"],
        sample_time=document["sample_time"],
        rivals=tuple((rival["label"], from_text(rival["model"], folder)) for rival in document["rivals"]),
        noise=tuple(document["noise"]),
        against_first=document["against_first"],
    )


def experiment_text(suggested: Mapping[str, Any]) -> str:
    """YAML that the excitation node takes as its parameter `experiment`, with what to know as comments."""
    import io

    from ruamel.yaml import YAML

    lines = [f"# {suggested['text']}"] + [f"# {outcome['text']}" for outcome in suggested.get("outcomes", ())]
    lines.append(f"# starts at rest at position {suggested.get('start', 0.0):.6g}; lasts {suggested['duration']:g} s")
    buffer = io.StringIO()
    plain = {
        key: list(value) if isinstance(value, list | tuple) else value for key, value in suggested["signal"].items()
    }
    YAML().dump({"signal": plain, "adds_to": suggested["adds_to"]}, buffer)
    return "\n".join(lines) + "\n" + buffer.getvalue()
