"""How a diagnosis or a ladder ends, what its data cannot show, and what its shares are shares of: in the same words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.diagnosis.ladder import Ladder
from idloop.diagnosis.screening.command_response import CommandResponse
from idloop.diagnosis.screening.proposals import proposals
from idloop.diagnosis.search.step import MISSING as UNFINISHED
from idloop.diagnosis.search.step import NOISE_VERDICTS
from idloop.estimation.direction import OPPOSITE_DIRECTION
from idloop.reporting.scores import judging
from idloop.reporting.terms import effect_words
from idloop.spelling import joined_names
from idloop.validation.drive import MOST_NOISE
from idloop.validation.words import force_text

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Diagnosis
    from idloop.reporting.residual_findings import ResidualFinding

# Of a ladder; a diagnosis that ends as missing has a best effect to name.
VERDICTS = {
    "adequate": "nothing significant is left",
    "unknown_structure": "what is left has a shape that no effect of the catalogue explains",
    "not_excited": "nothing significant is left, but this data cannot show everything",
    "missing": "stopped before the end, an effect is still missing",
}
MISSING = "an effect is missing"
UNEXPLAINED = "something that no effect of the catalogue explains"
# The same where the reader has named the effects to choose from: of the others the data were not asked.
UNEXPLAINED_BY_THESE = "something that none of the effects looked for explains"
_TELLS_NOTHING = "the measured motion does not follow the command: this data says nothing about the axis"
_OF_THESE = {
    **VERDICTS,
    "adequate": "nothing significant is left of what was looked for",
    "unknown_structure": "what is left has a shape that none of the effects looked for explains",
    "not_excited": "nothing significant is left of what was looked for, but this data cannot show everything",
}

_CRITERIA = {
    "auto": "chosen from the data",
    "prediction": "one-step prediction errors",
    "simulation": "free-run errors",
    "force": "the drive force that the measured motion leaves unexplained",
}

# So many names are read; of more the number says enough.
_NAMED = 6

_LEFT = {
    "prediction": "the one-step prediction errors that the model without it leaves",
    "simulation": "the free-run errors that the model without it leaves",
    "force": "the drive force that the model without it leaves unexplained",
}


def conclusion(ladder: Ladder, left: Sequence[ResidualFinding] = (), only: str = "") -> str:
    """How a ladder ends, what the reader is to conclude first.

    `left`: residual tests of the last model on the fitted data. `only`: what was looked for where that was not the
    whole catalogue, as `scope_text` says it.
    """
    end = ending(ladder.verdict, only, ladder.response)
    names = [] if ladder.response.uninformative else confounding_effects(ladder)
    if names:
        return (
            f"{unexplained_cause(only)} is missing: {joined_names(names)} {'take' if len(names) > 1 else 'takes'} its"
            f" place in the one-step prediction and {'make' if len(names) > 1 else 'makes'} the free run worse;"
            f" {'' if only else 'of the catalogue '}{end}"
        )
    return reserved_ending(ladder.verdict, left, _judging_errors(ladder), only, ladder.response)


def reserved_ending(
    verdict: str,
    left: Sequence[ResidualFinding],
    errors: Mapping[str, Any],
    only: str = "",
    response: CommandResponse = CommandResponse.FOLLOWS,
) -> str:
    """As `ending`; what the residual tests or the errors of the model say against a verdict of noise comes first.

    `left`, `only`: as in `conclusion`. `errors`: as `idloop.diagnosis.model_errors` has them of the model.
    """
    end = ending(verdict, only, response)
    if verdict not in NOISE_VERDICTS or response.uninformative:
        return end
    follows = [one for one in left if one.test.follows]
    against = f"the errors still follow the {follows[0].drive}" if follows else large_error(errors)
    if not against:
        return end
    return f"{unexplained_cause(only)} is left: {against}; {'' if only else 'of the catalogue '}{end}"


def ending(verdict: str, only: str = "", response: CommandResponse = CommandResponse.FOLLOWS) -> str:
    """What the verdict of a ladder says by itself, or of a diagnosis that found nothing missing; `only` as above."""
    plain = (_OF_THESE if only else VERDICTS).get(verdict, verdict)
    end = f"{plain}: {only}" if only else plain
    if response is CommandResponse.REVERSED:
        return f"{OPPOSITE_DIRECTION}: turn one of the two, then ask again"
    return f"{_TELLS_NOTHING}; {end}" if response.uninformative else end


def unexplained_cause(only: str) -> str:
    """What to call that which no effect explains: none of the catalogue, or none of the few that `only` names."""
    return UNEXPLAINED_BY_THESE if only else UNEXPLAINED


def confounding_effects(ladder: Ladder) -> list[str]:
    """Effects of a ladder without which the model runs better, although nothing of the catalogue is left to add."""
    if ladder.verdict not in NOISE_VERDICTS:
        return []
    return [one.name for one in ladder.still_worsened if one.name in ladder.model.effect_names]


def leaves_much(ladder: Ladder) -> bool:
    """Whether the errors of the last model contradict a verdict of noise."""
    ends = ladder.verdict in NOISE_VERDICTS and not ladder.response.uninformative
    return ends and bool(large_error(_judging_errors(ladder)))


def large_error(errors: Mapping[str, Any]) -> str:
    """An error that is not that of a model with all effects, in words; empty where there is none.

    A force error that is known and above `MOST_NOISE` is not one of the sensors. Where none is known, a free run that
    begins anew at every fifth of a record is better than a constant: over all of it small forces add up.
    """
    force, runs = errors.get("force"), errors.get("anew", {})
    if force is not None and force >= MOST_NOISE:
        share = force_text(force, 3, " %")
        return f"the error of the drive force is {share}{'' if 'times' in share else ' of the commanded force'}"
    if force is None and runs and all(error >= 1.0 for error in runs.values()):
        return "the free run of every output is no better than a constant"
    return ""


def _judging_errors(ladder: Ladder) -> Mapping[str, Any]:
    errors: Mapping[str, Any] = getattr(ladder.steps[-1], judging(ladder))
    return errors


def criterion_words(criterion: str, bodies: int = 1) -> str:
    """What models are judged by; a chain of bodies has a force on each."""
    return _of_every_body(_CRITERIA.get(criterion, criterion), bodies)


def explained_of(criterion: str, bodies: int = 1) -> str:
    """Of what a share of the error is one under a criterion: "explains 40 % of ..."."""
    return _of_every_body(f"the power of {_LEFT.get(criterion, 'the errors that the model without it leaves')}", bodies)


def _of_every_body(text: str, bodies: int) -> str:
    return text if bodies < 2 else text.replace("the drive force", "the force on every body")


def basis(lacking: Sequence[str]) -> str:
    """Say which model a list of what the data cannot show belongs to, where effects are `lacking`; else empty."""
    is_ = "are" if len(lacking) > 1 else "is"
    return f"as long as {joined_names(list(lacking))} {is_} not in the model, " if lacking else ""


def effects_looked_for(result: Ladder | Diagnosis) -> tuple[str, ...]:
    """Effects that were looked for in the end, where the catalogue has more for this machine.

    Returns: as words, without their sites where every site was looked at; empty for the whole catalogue, and where the
    ladder does not say what was weighed.
    """
    weighed = list(dict.fromkeys(one.name for one in result.candidates))
    # Of an effect that was looked for and is in the model now, nothing further is weighed.
    steps, findings = (result.steps, result.findings) if isinstance(result, Ladder) else ((), ())
    found = [step.added.name for step in steps if step.added is not None and step.chosen_by == "diagnosis"]
    left = {one.name for one in proposals(result.model)} - set(weighed)
    # A ladder that has not been looked at to its end names neither candidates nor what the data can show.
    if not left or not (weighed or findings):
        return ()
    partly = {name.partition("@")[0] for name in left}
    named = (name if (kind := name.partition("@")[0]) in partly else kind for name in (*found, *weighed))
    return tuple(dict.fromkeys(effect_words(name) for name in named))


def scope_text(result: Ladder | Diagnosis) -> str:
    """Say what was looked for, to go on a sentence: "only backlash and dead zone were looked for"; else empty."""
    names = effects_looked_for(result)
    if not names:
        return ""
    what = joined_names(list(names)) if len(names) <= _NAMED else f"{len(names)} effects"
    return f"only {what} {'were' if len(names) > 1 else 'was'} looked for, not the whole catalogue"


def undetectable(ladder: Ladder) -> dict[str, str]:
    """Effects that the data cannot show, and why; empty words where that is not known any more.

    An effect that the model has, that one of the model contains, or that ties with one of it, is not among them: what
    is left of it beside the other says nothing about what the data could show. Nor is one that was significant and was
    not added: it is listed with the reason.
    """
    why = {candidate.name: candidate.why for candidate in ladder.candidates}
    shown = {*_found(ladder), *_significant(ladder)}
    return {name: why.get(name, "") for name in ladder.untestable if name not in shown}


def detection_limits(ladder: Ladder) -> dict[str, str]:
    """Size at which effects that were not found would have been, such as "width ≥ 0.012 V", but for `undetectable`."""
    hidden = {*_found(ladder), *_significant(ladder), *ladder.untestable}
    return {name: limit.short for name, limit in ladder.limits.items() if limit.short and name not in hidden}


def significant_not_added(ladder: Ladder) -> list[Candidate]:
    """Refitted effects that are significant and were neither added nor passed over, the surest first."""
    named = {*ladder.model.effect_names, *ladder.added, *(name for step in ladder.steps for name in step.set)}
    named |= set(ladder.passed_over)
    found = [
        one
        for one in ladder.candidates
        if one.p_value < ladder.level and one.name not in named and np.isfinite(one.gain) and one.gain > 0.0
    ]
    return sorted(found, key=lambda one: one.p_value)


def _significant(ladder: Ladder) -> set[str]:
    """Effects that were significant in the end and were not added."""
    # Where the ladder has come to its end, whatever is significant still was passed over.
    open_ = significant_not_added(ladder) if ladder.verdict == UNFINISHED else []
    return {*ladder.passed_over, *(one.name for one in open_)}


def _found(ladder: Ladder) -> set[str]:
    """Effects that the model has, that one of the model contains, or that tie with one of it."""
    model = ladder.model
    found = {*model.effect_names, *ladder.added}
    for active in model.effects:
        found.update(f"{inner}@{active.at}" for inner in active.effect.contains)
    for step in ladder.steps:
        found.update(step.set)
    return found
