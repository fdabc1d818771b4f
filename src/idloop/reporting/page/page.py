"""The report as one HTML page that loads nothing: words, figures and the browser code that draws them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.diagnosis.candidate import effect_parameters
from idloop.diagnosis.design.expected_outcome import describe_signal
from idloop.diagnosis.equivalence.equivalent_effects import equivalent_effects_of_ladder
from idloop.p_values import p_text
from idloop.reporting.breakdowns import along_text
from idloop.reporting.estimates import NORMAL_95, held_parameters, parameter_rows, with_interval
from idloop.reporting.figures.effects import UNTESTABLE, ladder_rows
from idloop.reporting.page.contents import driven_step
from idloop.reporting.page.equations import equations, to_mathml
from idloop.reporting.page.page_figures import MOST_RECORDS, page_figures, where_places
from idloop.reporting.page.sheet import TEMPLATES, render_sheet
from idloop.reporting.residual_findings import ResidualFinding, residual_findings, residual_warnings
from idloop.reporting.scores import (
    TRAIN,
    VALIDATION,
    disagreements,
    judging,
    step_evidence,
    step_scores,
    step_title,
    unknown_force,
)
from idloop.reporting.terms import DATA_USE, FITTED, capitalised, effect_words, in_words, sentence, unbroken
from idloop.reporting.verdicts import (
    basis,
    conclusion,
    confounding_effects,
    criterion_words,
    detection_limits,
    effects_looked_for,
    ending,
    explained_of,
    leaves_much,
    scope_text,
    significant_not_added,
    undetectable,
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
    from idloop.reporting.page.contents import Contents


def render_page(contents: Contents) -> str:
    """Write the page: HTML that loads nothing, and its own policy forbids the browser to."""
    from markupsafe import Markup

    lines, symbols = equations(contents.ladder.model)
    # Markup: MathML of our own.
    return render_sheet(
        TEMPLATES / "report.html",
        page_figures(contents),
        name=contents.ladder.model.name,
        equations=[(Markup(to_mathml(one.latex, block=True)), one.about, effect_words(one.effect)) for one in lines],  # noqa: S704
        symbols={name: Markup(to_mathml(symbol)) for name, symbol in symbols.items()},  # noqa: S704
        **page_words(contents),
    )


def page_words(contents: Contents) -> dict[str, Any]:
    """Everything that the page says, by the names that the template uses; with the functions that write it."""
    ladder = contents.ladder
    left = residual_findings(judged.rows[-1][1] for judged in contents.judged if judged.use == FITTED)
    against = [f"warning: {one.text}" for one in ladder.worsened] + [in_words(line) for line in disagreements(ladder)]
    # Of a ladder that added nothing the headline says them.
    against += residual_warnings(ladder.verdict, left) if _lacking(ladder) else []
    kinds = [kind for kind in (VALIDATION, TRAIN) if any(getattr(step, kind) for step in ladder.steps)]
    force = ["force error, {} [%]"] if DRIVE_FORCE in quantities(ladder) else []
    functions = (
        capitalised,
        describe_signal,
        effect_words,
        figure_text,
        in_words,
        p_text,
        percent,
        sentence,
        unbroken,
        with_interval,
    )
    return {
        **{one.__name__: one for one in functions},
        "ladder": ladder,
        "model": ladder.model,
        "headline": headline(ladder, left),
        "verdict": verdict_text(ladder, left),
        "changes": changes(ladder),
        "no_force": unknown_force(ladder.steps, judging(ladder)),
        "against": [sentence(line) for line in against],
        "steps": [_step(n, one, one.added, contents) for n, one in enumerate(ladder.steps) if one.added is not None],
        "rungs": rungs(ladder),
        "columns": force + [f"FIT {name}, {{}} [%]" for name in ladder.model.output_names],
        "kinds": [(kind, DATA_USE[kind]) for kind in kinds],
        "noise": _noise(contents),
        "refuted": list(contents.refuted_noise),
        "banded": any(output.noise is not None for output in ladder.model.outputs),
        "judged": contents.judged,
        "most_records": MOST_RECORDS,
        "where": _where(contents),
        "residuals": contents.judged[0].residual_tests if contents.judged else [],
        "weighed": [row for row in ladder_rows(ladder) if row.standing != UNTESTABLE],
        "passed_over": ladder.passed_over,
        "untestable": undetectable(ladder),
        "detection_limits": {name: _with_powers(text) for name, text in detection_limits(ladder).items()},
        "suggested": ladder.suggested_experiment,
        "parameters": parameter_rows(ladder.model, held_parameters(ladder)),
        "describing": [one.name for one in contents.describing],
        "criterion": criterion_words(ladder.criterion, len(ladder.model.bodies)),
        "explained_of": explained_of(ladder.criterion, len(ladder.model.bodies)),
        "basis": basis(["what is still missing"] if ladder.verdict == "missing" else []),
        "provenance": {"commands": [], "seed": None, "versions": {}, "bags": [], **contents.provenance},
    }  # fmt: skip


_NOT_ADDED = {"missing": "An effect is missing, and none was added."}
_NOTHING = {
    "adequate": "Nothing is missing: the model explains this data.",
    "unknown_structure": "Something is missing that no effect of the catalogue explains.",
    "not_excited": "Nothing significant is missing, but this data cannot show everything.",
    **_NOT_ADDED,
}
# Where the reader has named the effects to choose from.
_NOTHING_OF_THESE = {
    "adequate": "Nothing that was looked for is missing.",
    "not_excited": "Nothing that was looked for shows, but this data cannot show everything.",
    **_NOT_ADDED,
}


def headline(ladder: Ladder, left: Sequence[ResidualFinding] = ()) -> str:
    """Say in one sentence what is missing; `left`: residual tests of the last model on the fitted data."""
    names = _lacking(ladder)
    if names:
        return f"Missing from the model: {joined_names(names)}."
    only, reserved = scope_text(ladder), residual_warnings(ladder.verdict, left)
    if reserved:
        return sentence(", ".join([ending(ladder.verdict, only, ladder.response), *reserved]))
    if only and ladder.verdict == "unknown_structure":
        return sentence(f"{unexplained_cause(only)} is missing")
    return (_NOTHING_OF_THESE if only else _NOTHING).get(ladder.verdict, "No effect was added.")


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
    """Say how the ladder ended, as a sentence; `left` as for `headline`."""
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

    Returns: ``name``, ``before``, ``after``, ``data``, and ``trend``: ``better``, ``worse`` or ``same``.
    """
    kind, up_to = judging(ladder), ""
    before, after = (step_scores(step, kind) for step in (ladder.steps[0], ladder.steps[-1]))
    if (driven := driven_step(ladder)) is not None:
        known = step_scores(ladder.steps[driven], kind)
        after, up_to = {**after, **{n: one for n, one in known.items() if n == DRIVE_FORCE}}, f", up to step {driven}"
    pairs = [(before[name], one) for name, one in after.items() if name in before]
    return [
        {
            "name": end.name,
            "data": f"{end.data}{up_to if end.quantity == DRIVE_FORCE else ''}",
            "before": begin.text,
            "after": end.text,
            "trend": begin.trend(end),
        }
        for begin, end in sorted(pairs, key=lambda pair: pair[1].quantity != DRIVE_FORCE)
    ]


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


def _step(number: int, step: Step, added: Candidate, contents: Contents) -> dict[str, Any]:
    ladder = contents.ladder
    twins = [group for group in equivalent_effects_of_ladder(ladder) if added.name in group.names]
    equivalent = {name for group in twins for name in group.names}
    drawn_at = contents.drawn_at.get(added.name)
    # With the values of the last model: those of the step are biased by what was still missing then.
    now = effect_parameters(ladder.model, added.name) or added.parameters
    return {
        "number": number,
        "added": added,
        "evidence": step_evidence(step),
        "ties": [effect_words(name) for name in ladder.rivals(step) if name not in equivalent],
        "replaces": capitalised(in_words(ladder.replaced(step))),
        "place": f"effect-{added.name}",
        "no_picture": no_picture(added.name, step.model),
        "parameters": [
            {"held": False, "stderr": None, "unit": "", **entry, "name": name.replace("_", " ")}
            for name, entry in now.items()
        ],
        "then": _then(added, ladder.model),
        "twins": [
            (joined_names([effect_words(name) for name in group.names if name != added.name]), group.checks)
            for group in twins
        ],
        "drawn": "" if drawn_at is None else f"Drawn with the model of step {drawn_at}: the last one does not show it.",
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


def quantities(ladder: Ladder) -> list[str]:
    """What the ladder's table has columns of: the drive force where it is known, then the outputs."""
    known = any(DRIVE_FORCE in step_scores(step, kind) for step in ladder.steps for kind in (VALIDATION, TRAIN))
    return [*([DRIVE_FORCE] if known else []), *ladder.model.output_names]


def rungs(ladder: Ladder) -> list[dict[str, Any]]:
    """Rows of the ladder's table: ``name``, ``evidence``, and ``errors`` of unseen and fitted data as `quantities`."""
    rows = []
    for step in ladder.steps:
        found = {kind: step_scores(step, kind) for kind in (VALIDATION, TRAIN)}
        cells = {
            kind: [one[name].cell if name in one else "–" for name in quantities(ladder)] for kind, one in found.items()
        }
        rows.append({"name": step_title(step), "evidence": step_evidence(step), "errors": cells})
    return rows


def _where(contents: Contents) -> list[dict[str, Any]]:
    """For each error its words before and after, and its figures with what stands out."""
    if not contents.judged:
        return []
    rows, found = contents.judged[0].rows, []
    for one in rows[0][1].where.maps:
        shown = [(v, one.along(v)) for name, v in where_places(contents) if name == one.name]
        maps = contents.judged[0].maps(one.name)
        label, after = maps[-1] if len(maps) > 1 else ("", None)
        found.append(
            {
                "name": one.name,
                "kind": one.kind if after is None or after.kind == one.kind else "",
                "figures": [
                    {"place": f"where-{one.name}-{v}", "title": TITLES[v], "caption": along_text(breakdown)}
                    for v, breakdown in shown
                    if breakdown is not None
                ],
                "before": one.lines(),
                "after": [] if after is None else after.lines(),
                "end": "end of the ladder" if label == rows[-1][0] else label,
            }
        )
    return found


def _with_powers(text: str) -> str:
    """Write what Python writes as 5.6e+03 with its power of ten."""
    return re.sub(r"\d(?:\.\d+)?e[+-]\d+", lambda found: tidy(found[0]), text)
