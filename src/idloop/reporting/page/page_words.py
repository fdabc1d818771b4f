"""The words and tables of a report's page, from the same objects as its figures."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.diagnosis.candidate import effect_parameters
from idloop.diagnosis.design.expected_outcome import describe_signal
from idloop.diagnosis.equivalence.equivalent_effects import EquivalentEffects, equivalent_effects_of_ladder
from idloop.p_values import p_text
from idloop.reporting.breakdowns import along_text
from idloop.reporting.detectability import detection_limits, significant_not_added, undetectable
from idloop.reporting.estimates import NORMAL_95, held_parameters, parameter_rows, with_interval
from idloop.reporting.figures.candidates import UNTESTABLE, ladder_rows
from idloop.reporting.ladder_errors import step_evidence, step_title
from idloop.reporting.page.contents import driven_step
from idloop.reporting.page.page_figures import MOST_RECORDS, effect_place, maps_of, where_place, where_places
from idloop.reporting.residual_findings import FEWEST_FOR_TESTS, ResidualFinding, residual_findings, residual_warnings
from idloop.reporting.scores import TRAIN, VALIDATION, Score, disagreements, judging, step_scores, unknown_force
from idloop.reporting.terms import DATA_USE, FITTED, capitalised, effect_words, in_words, sentence
from idloop.reporting.verdicts import (
    CRITERIA,
    basis,
    conclusion,
    confounding_effects,
    effects_looked_for,
    ending,
    explained_of,
    leaves_much,
    scope_text,
    unexplained_cause,
)
from idloop.spelling import joined_names
from idloop.validation.characteristic import no_picture
from idloop.validation.variables import TITLES
from idloop.validation.where import DRIVE_FORCE
from idloop.validation.words import figure_text, percent, tidy

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Ladder, Step
    from idloop.physics import Model
    from idloop.reporting.page.contents import Contents, Judged


def page_words(contents: Contents) -> dict[str, Any]:
    """Everything that the page says, as plain texts and tables.

    Returns: by the names that the template uses.
    """
    ladder, left = contents.ladder, _fitted_remainders(contents)
    return {
        "model": ladder.model,
        "headline": headline(ladder, left),
        "verdict": verdict_text(ladder, left),
        "changes": changes(ladder),
        "no_force": unknown_force(ladder.steps, judging(ladder)),
        "against": [
            sentence(line)
            for line in (
                *(f"warning: {one.text}" for one in ladder.worsened),
                *map(in_words, disagreements(ladder)),
                # Of a ladder that added nothing the headline says them.
                *(residual_warnings(ladder.verdict, left) if _lacking(ladder) else ()),
            )
        ],
        "steps": [
            {**_step(n, step, ladder), "drawn": _drawn(step.added.name, contents)}
            for n, step in enumerate(ladder.steps)
            if step.added is not None
        ],
        "rungs": rungs(ladder),
        "columns": [
            "force error, {} [%]" if one == DRIVE_FORCE else f"FIT {one}, {{}} [%]" for one in quantities(ladder)
        ],
        "kinds": [
            (kind, DATA_USE[kind])
            for kind in (VALIDATION, TRAIN)
            if any(getattr(step, kind) for step in ladder.steps)
        ],
        "noise": _noise(contents),
        "refuted": list(contents.refuted_noise),
        "banded": any(output.noise is not None for output in ladder.model.outputs),
        "records": [_record(judged) for judged in contents.judged],
        "most_records": MOST_RECORDS,
        "where": _where(contents),
        "residuals": _residuals(contents),
        "unknown": None if ladder.unknown is None else capitalised(ladder.unknown.text),
        "weighed": [
            {
                "name": effect_words(row.name),
                "explains": percent(row.explains).removesuffix(" %") if np.isfinite(row.explains) else "–",
                "gain": figure_text(row.gain, 4) if np.isfinite(row.gain) else "–",
                "evidence": row.evidence,
                "text": row.text,
            }
            for row in ladder_rows(ladder)
            if row.standing != UNTESTABLE
        ],
        "passed_over": _table(ladder.passed_over, "why"),
        "untestable": _table(undetectable(ladder), "why"),
        "detection_limits": _table(detection_limits(ladder), "size"),
        "findings": list(ladder.findings),
        "suggestion": _suggestion(ladder),
        "experiment": _experiment(ladder),
        "parameters": parameter_rows(ladder.model, held_parameters(ladder)),
        "describing": [
            {"name": one.name, "place": f"describing-{i}"} for i, one in enumerate(contents.describing)
        ],
        "criterion": CRITERIA.get(ladder.criterion, ladder.criterion),
        "explained_of": explained_of(ladder.criterion),
        "residual_of": contents.judged[0].title if contents.judged else "",
        "basis": basis(["what is still missing"] if ladder.verdict == "missing" else []),
        "level": figure_text(100.0 * ladder.level, 3),
        "provenance": {"commands": [], "seed": None, "versions": {}, "bags": [], **contents.provenance},
    }  # fmt: skip


_NOT_ADDED = "An effect is missing, and none was added."


def headline(ladder: Ladder, left: Sequence[ResidualFinding] = ()) -> str:
    """Say in one sentence what is missing.

    `left`: residual tests of the last model on the fitted data.
    """
    names = _lacking(ladder)
    if names:
        return f"Missing from the model: {joined_names(names)}."
    reserved = residual_warnings(ladder.verdict, left)
    if reserved:
        return sentence(", ".join([ending(ladder.verdict, scope_text(ladder), ladder.response), *reserved]))
    if effects_looked_for(ladder):
        return {
            "adequate": "Nothing that was looked for is missing.",
            "unknown_structure": sentence(f"{unexplained_cause(scope_text(ladder))} is missing"),
            "not_excited": "Nothing that was looked for shows, but this data cannot show everything.",
            "missing": _NOT_ADDED,
        }.get(ladder.verdict, "No effect was added.")
    return {
        "adequate": "Nothing is missing: the model explains this data.",
        "unknown_structure": "Something is missing that no effect of the catalogue explains.",
        "not_excited": "Nothing significant is missing, but this data cannot show everything.",
        "missing": _NOT_ADDED,
    }.get(ladder.verdict, "No effect was added.")


def _lacking(ladder: Ladder) -> list[str]:
    """What the headline names: effects that were added, and what no effect explains."""
    # An effect that stands in for another one is not what is missing.
    in_place = confounding_effects(ladder)
    names = [_or_its_rivals(ladder, name) for name in ladder.added if name not in in_place]
    something = unexplained_cause(scope_text(ladder))
    if in_place or leaves_much(ladder) or (names and ladder.verdict == "unknown_structure"):
        names.append(something)
    shape = ladder.unknown
    if shape is not None and shape.coefficient and ladder.verdict == "unknown_structure":
        names = [*(name for name in names if name != something), f"{shape.of} that is not constant"]
    return list(dict.fromkeys(names))


def _or_its_rivals(ladder: Ladder, name: str) -> str:
    """An added effect without its place, and the others that it may as well be."""
    plain = effect_words(name).partition(" @ ")[0]
    step = next((s for s in ladder.steps if s.added is not None and s.added.name == name), None)
    rivals = () if step is None else ladder.rivals(step)
    others = list(dict.fromkeys(effect_words(rival).partition(" @ ")[0] for rival in rivals))
    others = [other for other in others if other != plain]
    if not others:
        return plain
    if len(others) == 1:
        return f"{plain} or {others[0]}"
    return f"{plain} or one of {len(others)} others that this data cannot distinguish from it"


def verdict_text(ladder: Ladder, left: Sequence[ResidualFinding] = ()) -> str:
    """Say how the ladder ended, as a sentence.

    `left`: residual tests of the last model on the fitted data.
    """
    only = scope_text(ladder)
    end = conclusion(ladder, left, only)
    if end.startswith(unexplained_cause(only)):
        return sentence(end)
    if only:
        return f"{_end_text(ladder, end.partition(':')[0])} {capitalised(only)}."
    if ladder.verdict == "adequate" and not _lacking(ladder) and residual_warnings(ladder.verdict, left):
        return ""  # the headline says it all
    return _end_text(ladder, end)


def _end_text(ladder: Ladder, end: str) -> str:
    """How a ladder ended, with what the headline does not say."""
    hidden = undetectable(ladder)
    if ladder.verdict == "not_excited" and hidden:
        names = joined_names([effect_words(name) for name in hidden])
        return f"{'Nothing further' if ladder.added else 'Nothing'} shows, but this data cannot show {names}."
    if not ladder.added and ladder.verdict == "adequate" and not effects_looked_for(ladder):
        return "What is left is noise."
    over = [effect_words(one.name) for one in significant_not_added(ladder)]
    if ladder.verdict == "missing" and over:
        return f"Significant and not added: {joined_names(over)}."
    shape = ladder.unknown
    if ladder.verdict == "unknown_structure" and shape is not None and len(shape.force):
        if shape.coefficient:
            apart = figure_text(float(np.ptp(shape.force)), 3)
            return f"{capitalised(shape.of)} changes over {shape.along}: by {apart} {shape.force_unit} in all."
        # That nothing in the catalogue explains it stands in the headline.
        largest = figure_text(float(np.max(np.abs(shape.force))), 3)
        return f"What is left has a shape over {shape.along}: up to {largest} {shape.force_unit}."
    return sentence(end)


def changes(ladder: Ladder) -> list[dict[str, str]]:
    """Error of the first and the last step: the drive force, then the FIT of each output; unseen data where there is.

    Returns
    -------
    list of dict
        ``name``, ``before``, ``after``, ``data``, and ``trend``: ``better``, ``worse`` or ``same``.
    """
    kind, rows = judging(ladder), []
    before, after = (step_scores(step, kind) for step in (ladder.steps[0], ladder.steps[-1]))
    driven = driven_step(ladder)
    end = after.get(DRIVE_FORCE) if driven is None else step_scores(ladder.steps[driven], kind).get(DRIVE_FORCE)
    if DRIVE_FORCE in before and end is not None:
        up_to = "" if driven is None else f", up to step {driven}"
        rows.append(_change(before[DRIVE_FORCE], end, up_to))
    return rows + [_change(before[name], one) for name, one in after.items() if name in before and name != DRIVE_FORCE]


def _change(before: Score, after: Score, up_to: str = "") -> dict[str, str]:
    texts = {"before": before.text, "after": after.text, "trend": before.trend(after)}
    return {"name": after.name, "data": f"{after.data}{up_to}", **texts}


def _drawn(name: str, contents: Contents) -> str:
    """With which model a characteristic is drawn, where not with the last one."""
    place = contents.drawn_at.get(name)
    if place is None:
        return ""
    return f"Drawn with the model of step {place}: the last one does not show it."


def _noise(contents: Contents) -> dict[str, str]:
    """Noise of every output as its cell of the table says it."""
    texts = {}
    for output in contents.ladder.model.outputs:
        texts[output.name] = "from the data"
        if output.noise is not None:
            texts[output.name] = f"{figure_text(output.noise, 3)} {output.unit}"
        if output.name in contents.refuted_noise:
            most = figure_text(contents.refuted_noise[output.name], 3)
            texts[output.name] = f"at most {most} {output.unit} on this data; the model file says {texts[output.name]}"
    return texts


def _fitted_remainders(contents: Contents) -> list[ResidualFinding]:
    return residual_findings(judged.rows[-1][1] for judged in contents.judged if judged.use == FITTED)


def _step(number: int, step: Step, ladder: Ladder) -> dict[str, Any]:
    added, last = step.added, ladder.model
    if added is None:
        raise ValueError("the first step adds nothing")
    # Of the last model: those of the step are biased by what was still missing then.
    now = effect_parameters(last, added.name) or added.parameters
    twins = [group for group in equivalent_effects_of_ladder(ladder) if added.name in group.names]
    equivalent = {name for group in twins for name in group.names}
    others = [effect_words(name) for name in ladder.rivals(step) if name not in equivalent]
    return {
        "number": number,
        "name": capitalised(effect_words(added.effect)),
        "site": added.at,
        "text": added.text,
        "evidence": step_evidence(step),
        # What is read off the readings explains no error.
        "explains": percent(added.explains).replace(" ", "\u00a0") if added.explains > 0.0 else "",
        "ties": others,
        "replaces": capitalised(in_words(ladder.replaced(step))),
        "place": effect_place(added.name),
        "no_picture": no_picture(added.name, step.model),
        "parameters": [
            {
                "name": name.replace("_", " "),
                "value": with_interval(float(entry["value"]), entry.get("stderr")),
                "unit": entry.get("unit", ""),
                "held": bool(entry.get("held")),
            }
            for name, entry in now.items()
        ],
        "then": _then(added, last),
        "twins": [_said(group, added.name) for group in twins],
    }


def _then(added: Candidate, last: Model) -> str:
    """An effect's strength when it was added, where the last step has another one; empty otherwise."""
    name, entry = next(iter(added.parameters.items()), ("", {}))
    final = {p.name: p for p in last.parameters}.get(f"{added.name}.{name}")
    if not name:
        return ""
    if final is None:
        return "Later steps replaced it."
    then = with_interval(float(entry["value"]), entry.get("stderr"))
    if then == with_interval(final.value, final.stderr):
        return ""
    unit = f" {final.unit}" if final.unit != "-" else ""
    gone = final.stderr is not None and abs(final.value) < NORMAL_95 * final.stderr
    tail = "; in the last model it does not differ significantly from 0." if gone else "."
    return f"When it was added: {name.replace('_', ' ')} {then}{unit}{tail}"


def _said(group: EquivalentEffects, name: str) -> dict[str, Any]:
    others = [effect_words(other) for other in group.names if other != name]
    return {"others": joined_names(others), "checks": [capitalised(check) for check in group.checks]}


def quantities(ladder: Ladder) -> list[str]:
    """What the ladder's table has columns of: the drive force where it is known, then the outputs."""
    known = any(DRIVE_FORCE in step_scores(step, kind) for step in ladder.steps for kind in (VALIDATION, TRAIN))
    return [*([DRIVE_FORCE] if known else []), *ladder.model.output_names]


def rungs(ladder: Ladder) -> list[dict[str, Any]]:
    """Rows of the ladder's table: every number that ``ladder.json`` has of each step.

    Returns: ``name``, ``evidence``, and ``errors``: for unseen and fitted data, those of `quantities`.
    """
    rows = []
    for step in ladder.steps:
        errors = {}
        for kind in (VALIDATION, TRAIN):
            found = step_scores(step, kind)
            errors[kind] = [found[name].cell if name in found else "–" for name in quantities(ladder)]
        rows.append(
            {
                "name": step_title(step),
                "evidence": step_evidence(step),
                "errors": errors,
            }
        )
    return rows


def _record(judged: Judged) -> dict[str, Any]:
    record = judged.record
    gaps = [finding.text for finding in record.findings if finding.level == "warning"]
    return {
        "use": judged.use,
        "name": record.name,
        "seconds": figure_text(record.duration, 4),
        "samples": len(record.time),
        "step": figure_text(1e3 * record.sample_time, 4),
        "command": f"{figure_text(float(np.min(record.input)), 3)} … {figure_text(float(np.max(record.input)), 3)}",
        "unit": record.input_unit,
        "loop": "closed" if record.reference is not None else "open or not recorded",
        "warnings": gaps,
    }


def _where(contents: Contents) -> list[dict[str, Any]]:
    """For each error its words before and after, and its figures with what stands out."""
    if not contents.judged:
        return []
    rows = contents.judged[0].rows
    found = []
    places = where_places(contents)
    for one in rows[0][1].where.maps:
        figures = []
        for name, variable in places:
            breakdown = one.along(variable)
            if name == one.name and breakdown is not None:
                caption = along_text(breakdown)
                figures.append(
                    {"place": where_place(name, variable), "title": TITLES[variable], "caption": caption}
                )  # fmt: skip
        maps = maps_of(contents.judged[0], one.name)
        label, after = maps[-1] if len(maps) > 1 else ("", None)
        found.append(
            {
                "name": one.name,
                "kind": one.kind if after is None or after.kind == one.kind else "",
                "figures": figures,
                "before": one.lines(),
                "after": [] if after is None else after.lines(),
                "end": "end of the ladder" if label == rows[-1][0] else label,
            }
        )
    return found


def _residuals(contents: Contents) -> list[dict[str, Any]]:
    if not contents.judged or len(contents.judged[0].record.time) < FEWEST_FOR_TESTS:
        return []
    return [
        {
            "name": test.name,
            "place": f"residual-{test.name}",
            "white": "is white" if test.white else "is not white",
            "white_p": p_text(test.ljung_box_p),
            "free": test.freedom,
            "free_p": p_text(test.cross_p) if test.decided else "",
        }
        for test in contents.judged[0].rows[-1][1].residual_tests()
    ]


def _experiment(ladder: Ladder) -> str:
    suggested = ladder.suggested_experiment
    if suggested is None:
        return ""
    return describe_signal(suggested["signal"], suggested["adds_to"], suggested.get("unit", ""))


def _suggestion(ladder: Ladder) -> dict[str, Any] | None:
    """What the next experiment is for, and what each outcome would say, as sentences."""
    suggested = ladder.suggested_experiment
    if suggested is None:
        return None
    outcomes = [sentence(in_words(one["text"])) for one in suggested["outcomes"]]
    return {"text": sentence(in_words(suggested["text"])), "outcomes": outcomes}


def _table(texts: Mapping[str, str], column: str) -> list[dict[str, str]]:
    """Rows of a table by effect."""
    return [{"name": effect_words(name), column: in_words(_with_powers(text))} for name, text in texts.items()]


def _with_powers(text: str) -> str:
    """Write what Python writes as 5.6e+03 with its power of ten."""
    return re.sub(r"\d(?:\.\d+)?e[+-]\d+", lambda found: tidy(found[0]), text)
