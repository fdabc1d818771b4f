"""The page's words and numbers beside its figures, as plain JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.arrays import Array
from idloop.diagnosis.design.expected_outcome import describe_signal
from idloop.diagnosis.equivalence.equivalent_effects import find_equivalent_effects, without_equivalents
from idloop.diagnosis.search.step import NOISE_VERDICTS
from idloop.p_values import p_text
from idloop.reporting.breakdowns import along_text, notable_variables, shown_first
from idloop.reporting.estimates import held_parameters, parameter_rows, parameter_text
from idloop.reporting.figures.effects import drawn_lines
from idloop.reporting.page.equations import equations, to_mathml
from idloop.reporting.residual_findings import residual_warnings
from idloop.reporting.same_force import same_forces
from idloop.reporting.scores import (
    FORCE,
    FREE_RUN,
    Score,
    disagreements,
    judging,
    scores_of,
    step_evidence,
    step_scores,
    step_title,
    unknown_force,
)
from idloop.reporting.terms import DATA_USE, FITTED, UNSEEN, capitalised, effect_words, in_words, sentence, unbroken
from idloop.reporting.verdicts import basis, conclusion, criterion_words, ending, explained_of, scope_text
from idloop.reporting.workbench.files import MODEL, commands, named_model, offered
from idloop.reporting.workbench.state import model_version
from idloop.spelling import joined_names
from idloop.validation.characteristic import no_picture
from idloop.validation.variables import TITLES
from idloop.validation.where import DRIVE_FORCE
from idloop.validation.words import figure_text, percent, short

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Ladder, Step
    from idloop.physics import Model
    from idloop.reporting.residual_findings import ResidualFinding
    from idloop.reporting.workbench.assessment import Assessment
    from idloop.reporting.workbench.signals import Signals
    from idloop.reporting.workbench.state import Activity, Evidence, Missing, Snapshot, Source
    from idloop.validation.characteristic import Characteristic
    from idloop.validation.residual import ResidualTest
    from idloop.validation.where import ErrorMap

MOST_STRETCHES = 5
TROUBLE = (
    "missed_deadlines", "silences", "clock_jumps", "saturated", "dropped_by_queue", "unreadable", "restarts",
    "skipped", "worker_failures",
)  # fmt: skip
_AS_THEY_ARE = ("commands", "equations", "outputs", "input")
LEVEL = 0.01  # family-wise error rate of a diagnosis, where no ladder has another one
_UNKNOWN_FORCE = {**Score(FORCE, DRIVE_FORCE, None).to_dict(), "about": "Not known."}
# A live graph fits and judges newer samples all the time.
_SEARCHED = " of the stretch that was searched; above are those of newer samples"
WORSE_BY = 1.1  # error of a free run, as a part of that before, that is worth a word
ONE_SIGN = 0.6  # share of its root mean square from which on the mean of an error is worth a word


def answered(source: Source, run: str, have: str = "") -> dict[str, Any]:
    """Answer a browser that asks what is new: run and version alone where it has the newest state, `have`, already."""
    snapshot = source.state.look()
    head = {"run": run, "change": snapshot.version}
    return head if have == f"{run}:{snapshot.version}" else {**head, **page_state(snapshot, source.signals)}


def page_state(snapshot: Snapshot, signals: Signals) -> dict[str, Any]:
    """Everything that the page shows in words, as JSON without NaN; `signals`: for names and units."""
    model, ladder, missing = snapshot.model, snapshot.ladder, snapshot.missing
    state = {
        "live": snapshot.live,
        "title": snapshot.title,
        "moves": snapshot.moves,
        "stop": snapshot.stop,
        "automatic": None if snapshot.automatic is None else list(snapshot.automatic),
        "effects": [effect_words(name) for name in snapshot.effects],
        "version": "" if model is None else model_version(model),
        "reason": snapshot.reason,
        "computing": snapshot.computing,
        "pending": snapshot.pending,
        "parameters": [] if model is None else parameter_rows(model, () if ladder is None else held_parameters(ladder)),
        "equations": [] if model is None else _equations(model, ladder),
        "files": offered(snapshot),
        "commands": commands(snapshot),
        "downloaded": named_model(snapshot) == MODEL,
        "inspected": list(snapshot.inspected),
        "outputs": [{"name": n, "unit": u} for n, u in zip(signals.names, signals.units, strict=True)],
        "band": _band(signals.noise),
        "input": {"name": signals.input_name, "unit": signals.input_unit},
        "followed": signals.followed,
        "head": _head(snapshot),
        "missing": None if missing is None else _missing(missing, snapshot),
        "evidence": None if snapshot.evidence is None else _evidence(snapshot.evidence, snapshot),
        "looks": snapshot.looks,
        "recordings": list(snapshot.recordings),
        "shown": snapshot.shown,
        "ladder": None if ladder is None else _ladder(ladder, snapshot.recordings, snapshot.given, live=snapshot.live),
        "suggested": None if snapshot.suggested is None else _suggested(snapshot.suggested),
        "limits": [{"name": name, "value": value.replace("-", "−")} for name, value in snapshot.limits],
        "activity": None if snapshot.activity is None else _activity(snapshot.activity),
        "note": None if snapshot.note is None else dict(vars(snapshot.note)),
        "health": [
            {**vars(one), "trouble": trouble(one.values), "values": dict(one.values)} for one in snapshot.health
        ],
        "assessment": None if snapshot.assessment is None else _assessment(snapshot, snapshot.assessment),
    }
    return {name: part if name in _AS_THEY_ARE else _unbroken(part) for name, part in state.items()}


def _activity(one: Activity) -> dict[str, Any]:
    """What is being worked out, with effects in words."""
    return {**vars(one), "text": in_words(one.text), "then": in_words(one.then)}


def _unbroken(part: Any) -> Any:
    """The same with no line break between a number and its unit."""
    if isinstance(part, str):
        return unbroken(part)
    if isinstance(part, dict):
        return {name: _unbroken(value) for name, value in part.items()}
    return [_unbroken(value) for value in part] if isinstance(part, list) else part


def _data_shown(snapshot: Snapshot) -> str:
    """What the recording that is shown served for; its name as well where there are several of that use."""
    name = snapshot.recordings[snapshot.shown] if snapshot.shown < len(snapshot.recordings) else ""
    use = next((use for use in (UNSEEN, FITTED) if name.endswith(f"({use})")), "")
    return f"{use} data" if use and _count(snapshot.recordings, use) == 1 else name


def _count(recordings: Sequence[str], use: str) -> int:
    return sum(one.endswith(f"({use})") for one in recordings)


def trouble(values: Mapping[str, str]) -> list[str]:
    """Say which counters of a check are not at zero: missed deadlines, drops, losses, limits."""
    counters = {name: value for name, value in values.items() if name in TROUBLE or name.startswith("lost/")}
    return [f"{name.replace('_', ' ')} {value}" for name, value in counters.items() if value not in ("", "0")]


def _parameters(parameters: Mapping[str, Mapping[str, Any]]) -> list[str]:
    return [parameter_text(name.replace("_", " "), entry) for name, entry in parameters.items()]


def _band(noise: Array) -> str:
    """What the band about a residual of zero holds: the noise that the model states, else the residual's bulk."""
    stated = np.isfinite(noise)
    known = ["the sensor noise"] * bool(np.any(stated)) + ["the one-step residual"] * (not np.all(stated))
    return f"95 % of {' or '.join(known)}"


def _head(snapshot: Snapshot) -> dict[str, Any]:
    """Scores of the present model, or why there are none; `pending` where they are those of the model before."""
    fit, found = snapshot.fit, snapshot.assessment
    scores: dict[str, Score] = {}
    pending, why = False, "waiting for the first fit" if snapshot.live else "comparing model and record …"
    if snapshot.live and fit is not None:
        pending, why = snapshot.pending, f"no fit: {fit.error}" if fit.error else ""
        scores = {} if fit.error else scores_of({"fit": fit.unseen}, f"unseen data, {fit.seconds:.1f} s")
    elif not snapshot.live and found is not None:
        pending, why = snapshot.pending or not snapshot.assessed, ""
        scores = scores_of(found.errors, _data_shown(snapshot), model_version(found.model))
    if snapshot.live and scores and found is not None and snapshot.assessed:
        force = scores_of(found.errors, found.record).get(DRIVE_FORCE)
        scores |= {} if force is None else {DRIVE_FORCE: force}
    ladder = snapshot.ladder
    judged = "" if ladder is None or not scores else _judged_by(ladder, force_known=DRIVE_FORCE in scores)
    return {"scores": [one.to_dict() for one in scores.values()], "pending": pending, "why": why, "judged": judged}


def _equations(model: Model, ladder: Ladder | None) -> list[dict[str, Any]]:
    """Equations of the present model; what the newest step has added is marked."""
    steps = () if ladder is None else ladder.steps
    newest = steps[-1].added.name if steps and steps[-1].added is not None else ""
    return [
        {
            "math": to_mathml(one.latex, block=True),
            "about": one.about,
            "effect": effect_words(one.effect),
            "new": bool(newest) and one.effect == newest,
        }
        for one in equations(model, newest)[0]
    ]


def _missing(found: Missing, snapshot: Snapshot) -> dict[str, Any]:
    ladder, pictures = snapshot.ladder, snapshot.pictures
    lacking = [effect_words(name) for name in found.pair or found.set] if found.verdict == "missing" else []
    lacking = ["what is missing"] if len(found.set) > 1 and not found.pair else lacking
    level = LEVEL if ladder is None else ladder.level
    twins = () if ladder is None else find_equivalent_effects(ladder.model, found.set)
    twins += same_forces(found.candidates, without_equivalents(found.set, twins))
    why = {one.name: one.why for one in found.candidates}
    return {
        "verdict": found.verdict,
        "conclusion": _conclusion(found.verdict, ladder, _remainders(found, snapshot)),
        "explains": f"of {_explained(ladder)}",
        "basis": capitalised(f"{basis(lacking)}this data cannot show"),
        "line": found.line,
        "error": found.error,
        "tied": [effect_words(name) for name in found.set],
        "pair": [effect_words(name) for name in found.pair],
        # What is one equation no experiment tells apart, a check by hand does.
        "separable": len(without_equivalents(found.set, twins)) > 1,
        "twins": [
            {"text": sentence(in_words(one.text)), "checks": [sentence(check) for check in one.checks]} for one in twins
        ],
        "candidates": [_candidate(one, place, found, pictures, level) for place, one in enumerate(found.candidates)],
        "untestable": [{"name": effect_words(name), "why": why.get(name, "")} for name in found.untestable],
        "unknown": sentence("" if found.unknown is None else found.unknown.text),
        "elsewhere": _elsewhere(found, snapshot),
    }


def _explained(ladder: Ladder | None) -> str:
    return explained_of("") if ladder is None else explained_of(ladder.criterion, len(ladder.model.bodies))


def _evidence(found: Evidence, snapshot: Snapshot) -> dict[str, Any]:
    """How the evidence has grown; `current` where it was weighed against a model of the present effects."""
    newest = {name: values[-1] for name, values in found.lines.items() if values}
    keys = drawn_lines(found.lines, found.decided)
    # Of recordings stretches are scored, thinned or over windows: their number is not that of the samples.
    decided = {
        name: f"{one.seconds:.3g} s" if found.recorded else f"{one.seconds:.4g} s, {one.samples} samples"
        for name, one in found.decided.items()
    }
    rows = [
        {
            "name": name,
            "words": effect_words(name),
            "line": keys.get(name),
            "log_e": f"{round(newest[name], 1) + 0.0:.1f}".replace("-", "−"),
            "decided": decided.get(name, "not added" if found.recorded and newest[name] >= found.threshold else "open"),
        }
        for name in sorted(newest, key=lambda name: -newest[name])
    ]
    return {
        "line": ". ".join(filter(None, (capitalised(in_words(found.line)), _outweighs(newest, snapshot)))),
        "hint": _evidence_hint(found),
        "current": found.effects == tuple(snapshot.effects),
        "effects": rows,
        "ended": in_words(found.ended),
        "estimates": [
            {**vars(one), "name": effect_words(one.name.replace(".", " ")), "why": capitalised(in_words(one.why))}
            for one in found.estimates
        ],
    }


def _outweighs(newest: Mapping[str, float], snapshot: Snapshot) -> str:
    """Why the effect with the most evidence is not the one that is named; empty where it is."""
    missing = snapshot.missing
    most = max(newest, key=lambda name: newest[name], default="")
    if missing is None or missing.verdict != "missing" or most in (*missing.set, *missing.pair):
        return ""
    level = LEVEL if snapshot.ladder is None else snapshot.ladder.level
    why = next((_why_not(one, missing, level) for one in missing.candidates if one.name == most), "")
    return f"{capitalised(effect_words(most))} has more evidence and is not named: {in_words(why)}" if why else ""


def _evidence_hint(found: Evidence) -> str:
    """How the evidence is scored, and where it decides; empty without a threshold."""
    if not math.isfinite(found.threshold):
        return ""
    compared = "Where several are decided, a diagnosis compares them with one another."
    line = f"An effect is decided where log E reaches the dashed line, log(m/α) = {found.threshold:.1f}"
    if found.recorded:
        reserve = "and stays there, unless the answer says why it is not added"
        return f"Fits to the other stretches of the records score each stretch. {line}, {reserve}. {compared}"
    holds = "this threshold holds at any time"
    return f"Fits to earlier samples score each stretch of new ones. {line}; {holds}. {compared}"


def _remainders(missing: Missing, snapshot: Snapshot) -> Sequence[ResidualFinding]:
    """Residual tests of the diagnosed model; a live graph sends none, and those of its newest samples serve."""
    if not snapshot.live:
        return missing.left
    return snapshot.assessment.residual_tests if snapshot.assessment is not None and snapshot.assessed else ()


def _elsewhere(missing: Missing, snapshot: Snapshot) -> str:
    """What the residual tests of an unseen record that is shown say against a verdict on the fitted ones."""
    found, shown = snapshot.assessment, snapshot.recordings[snapshot.shown : snapshot.shown + 1]
    unseen = all(one.endswith(f"({UNSEEN})") for one in shown)
    if found is None or not snapshot.assessed or not unseen or snapshot.live or missing.verdict not in NOISE_VERDICTS:
        return ""
    known = {one.test.name for one in missing.left if one.test.follows}
    follows = [one for one in found.residual_tests if one.test.follows and one.test.name not in known]
    if not follows:
        return ""
    return (
        f"On {found.record}, which is unseen, the one-step error of {joined_names([o.test.name for o in follows])}"
        f" follows the {follows[0].drive}: an error of the parameters, or something that the fitted data do not show."
    )


def _conclusion(verdict: str, ladder: Ladder | None, left: Sequence[ResidualFinding]) -> str:
    """What to conclude where the plain words of the verdict would say too much; empty otherwise."""
    if verdict == "missing":
        return ""
    known = ladder if ladder is not None and ladder.verdict == verdict else None
    only = "" if known is None else scope_text(known)
    end = ending(verdict) if known is None else conclusion(known, left, only)
    # Where the errors follow the command or an effect stands in for another one, the conclusion says so itself.
    itself = known is not None and end != ending(verdict, only, known.response)
    reserved = [] if itself else residual_warnings(verdict, left)
    return sentence(", ".join([end, *reserved])) if reserved or end != ending(verdict) else ""


def _candidate(
    one: Candidate, place: int, found: Missing, pictures: Mapping[str, Characteristic] | None, level: float
) -> dict[str, Any]:
    significant = one.name in found.set or one.name in found.pair
    picture = None if pictures is None else pictures.get(one.name)
    why = "The picture is being drawn."
    if pictures is not None:
        why = "" if picture is not None else f"No picture: {no_picture(one.name, one.model)}."
    return {
        "name": one.name,
        "words": effect_words(one.name),
        "significant": significant,
        "best": significant and place == 0,
        "fitted": bool(one.parameters) or math.isfinite(one.gain),
        "p": p_text(one.p_value),
        "explains": one.explains,
        "share": percent(one.explains),
        "testable": one.testable,
        "why": one.why,
        "text": one.text,
        "replaces": effect_words(one.replaces) if one.replaces else "",
        "below_level": one.p_value < level,
        "passed_over": "" if significant else in_words(_why_not(one, found, level)),
        "parameters": _parameters(one.parameters),
        "picture": None if picture is None else _picture(picture),
        "no_picture": why,
    }


def _why_not(one: Candidate, found: Missing, level: float) -> str:
    """Why an effect that is significant by itself is not named; empty where it is not significant."""
    if one.name in found.passed_over:
        return found.passed_over[one.name]
    if one.p_value >= level:
        return ""
    if found.verdict == "missing":
        named = next((other for other in found.candidates if other.name in found.set), None)
        if named is not None and named.explains < one.explains:
            words = effect_words(named.name)
            return f"{words} is the simpler one and goes first; what this one has beyond it shows once that is added"
        return "what is named explains more; whether this one is left shows once that is in the model"
    return "its gain is within what differs from one part of the record to another"


def _picture(one: Characteristic) -> dict[str, Any]:
    """What is left of the data along a variable, and the fitted effect; a few points for a small picture."""
    return {
        "x": drawing.label(one.variable, one.unit),
        "y": drawing.label(one.quantity, one.quantity_unit),
        "curve": _points(one.curve_x, one.curve_y),
        "data": _points(one.centre, one.mean),
    }


def _points(x: Any, y: Any) -> list[list[float]]:
    return [[float(f"{a:.5g}"), float(f"{b:.5g}")] for a, b in zip(x, y, strict=True) if math.isfinite(a + b)]


def _ladder(
    ladder: Ladder, recordings: Sequence[str], given: Step | None = None, *, live: bool = False
) -> dict[str, Any]:
    kind = judging(ladder)
    count = _count(recordings, DATA_USE[kind])
    together = f" ({count} recordings together)" if count > 1 else ""
    every = (*([] if given is None else [given]), *ladder.steps)
    found = [step_scores(step, kind) for step in every]
    known = [DRIVE_FORCE in one for one in found]
    # What is known of one step has its place in all of them.
    rows = [[one.to_dict() for one in scores.values()] for scores in found]
    for row, has in zip(rows, known, strict=True):
        if any(known) and not has:
            row.append(_UNKNOWN_FORCE)
    errors = f"Errors of the {DATA_USE[kind]} data{together}{_SEARCHED if live else ''}."
    texts = (errors, _judged_by(ladder, force_known=any(known)), unknown_force(every, kind))
    beware = list(_fitted_and_worse(found)) if given is not None and len(ladder.steps) == 1 else []
    beware += [f"warning: {one.text}" for one in ladder.worsened] + disagreements(ladder)
    return {
        # Before the fit, with its own errors: what the fit has done is no part of what an effect has done.
        "given": None if given is None else rows.pop(0),
        "steps": [
            {
                "number": number,
                "words": step_title(step),
                "by": "the same model, fitted" if number == 0 and given is not None else step_evidence(step),
                "ties": [effect_words(name) for name in ladder.rivals(step)],
                "parameters": [] if step.added is None else _parameters(step.added.parameters),
                "scores": rows[number],
            }
            for number, step in enumerate(ladder.steps)
        ],
        "verdict": ladder.verdict,
        "data": " ".join(filter(None, texts)),
        "beware": [sentence(in_words(text)) for text in beware],
    }


def _fitted_and_worse(found: Sequence[Mapping[str, Score]]) -> Iterator[str]:
    """Free runs on the data that judge which the fit of the model has made worse."""
    given, fitted = found
    left = [{k: 100.0 - (o.value or 0.0) for k, o in one.items() if o.view == FREE_RUN} for one in (given, fitted)]
    worse = [fitted[name].name for name, now in left[1].items() if now > WORSE_BY * left[0].get(name, now)]
    if worse:
        yield f"the fit makes {joined_names(worse)} worse on these data: it cannot make up for what the model lacks"


def _judged_by(ladder: Ladder, *, force_known: bool) -> str:
    """Name the error that decides about effects, and say where that of the drive force is not among the numbers."""
    by = "what the data show best"
    if ladder.criterion != "auto":
        by = criterion_words(ladder.criterion, len(ladder.model.bodies))
    hidden = ladder.criterion == "force" and not force_known
    return f"Effects are judged by {by}{'; its error is not shown, too much of it is sensor noise' if hidden else ''}."


def _suggested(found: Mapping[str, Any]) -> dict[str, Any]:
    signal, adds_to, duration = (found.get(name) for name in ("signal", "adds_to", "duration"))
    described = describe_signal(signal, str(adds_to), str(found.get("unit", ""))) if signal and adds_to else ""
    return {
        "signal": capitalised(described),
        "text": capitalised(in_words(str(found.get("text", "")))),
        "duration": duration if duration is not None and math.isfinite(duration) else None,
        "outcomes": [capitalised(in_words(str(one.get("text", "")))) for one in found.get("outcomes", ())],
        "motion": [_predicted(one) for one in found.get("motion", ())],
    }


def _predicted(one: Mapping[str, Any]) -> dict[str, Any]:
    """Predicted range of one quantity beside its limits; `inside` only where it has some and keeps them."""
    low, high, limits = float(one["low"]), float(one["high"]), [float(limit) for limit in one["limits"]]
    room = 1e-9 * max([abs(limit) for limit in limits], default=0.0)
    inside = bool(limits) and low >= limits[0] - room and high <= limits[1] + room
    allowed = f"{figure_text(limits[0], 6)} to {figure_text(limits[1], 6)} {one['unit']}" if limits else "no limit"
    return {
        "name": one["name"],
        "range": f"{short(low)} to {short(high)} {one['unit']}",
        "limit": allowed,
        "inside": inside,
        "outside": bool(limits) and not inside,
    }


def _assessment(snapshot: Snapshot, found: Assessment) -> dict[str, Any]:
    first = shown_first(found.where.maps)
    return {
        "record": found.record,
        "version": model_version(found.model),
        "current": snapshot.assessed and not snapshot.computing,
        "maps": [_map(one) for one in found.where.maps],
        "outputs": _outputs(found),
        "output": found.looked_at(""),
        "poles": [] if found.frequency is None else found.frequency.pole_texts,
        "telling": None if first is None else dict(zip(("error", "variable"), first, strict=True)),
    }


def _outputs(found: Assessment) -> list[dict[str, str]]:
    """What the tests say of the one-step error of each output, the numbers beside its figures."""
    tests = {one.test.name: _tests(one.test) for one in found.residual_tests}
    readable = (lambda number: "") if found.frequency is None else found.frequency.frequency_note
    return [
        {"name": output.name, "tests": tests.get(output.name, ""), "readable": readable(number)}
        for number, output in enumerate(found.model.outputs)
    ]


def _tests(test: ResidualTest) -> str:
    white = f"{'white' if test.white else 'not white'} (Ljung-Box, {p_text(test.ljung_box_p)})"
    return f"is {white} and {test.freedom}{f' ({p_text(test.cross_p)})' if test.decided else ''}"


def _map(one: ErrorMap) -> dict[str, Any]:
    return {
        "name": one.name,
        "unit": one.unit,
        "kind": one.kind,
        "why": sentence(one.why),
        "rms": f"{short(one.rms)} {one.unit}",
        "relative": one.relative_text,
        "variables": [b.variable for b in one.breakdowns],
        "left_out": dict(one.left_out),
        "loud": notable_variables(one),
        "along": {
            **{name: f"No figure over {TITLES[name]}: {why}." for name, why in one.left_out.items()},
            **{b.variable: f"{sentence(along_text(b))} {_everywhere(one)}".rstrip() for b in one.breakdowns},
        },
        "stretches": [
            {"start": s.start, "stop": s.stop, "error": percent(s.error), "time": percent(s.time), "text": s.text}
            for s in one.loud_stretches[:MOST_STRETCHES]
        ],
    }


def _everywhere(one: ErrorMap) -> str:
    """Say how much of an error is one constant, which no curve over a variable has in it; empty where it is little."""
    if not (math.isfinite(one.mean) and abs(one.mean) > ONE_SIGN * one.rms):
        return ""
    part = percent((one.mean / one.rms) ** 2)
    return f"{part} of the error is the same everywhere: {short(one.mean)} {one.unit} on average."
