"""Climb the ladder: diagnose, add, refit, until nothing significant is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from idloop.diagnose.candidate import Candidate, effect_parameters
from idloop.diagnose.choice import choose_kind
from idloop.diagnose.common_noise import with_common_whitening
from idloop.diagnose.diagnosis import MISSING, Diagnosis, diagnose_fitted
from idloop.diagnose.errors import model_errors
from idloop.diagnose.intervals import with_stderr
from idloop.diagnose.ladder import Ladder, Step
from idloop.diagnose.proposals import proposals
from idloop.diagnose.refit import Refit, refit
from idloop.diagnose.setting import Setting, prepare_setting
from idloop.errors import IdloopError, InputError
from idloop.physics.effect_text import parse_effect
from idloop.physics.model import Model
from idloop.records import Record

Progress = Callable[[float, str], None]

# An earlier effect goes when the model without it loses less log-likelihood than this.
_NEEDLESS = 4.0


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def refine(
    model: Model,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    level: float = 0.01,
    criterion: str = "auto",
    effects: Sequence[str] | None = None,
    seed: int = 0,
    most: int = 8,
    ladder: Ladder | None = None,
    progress: Progress | None = None,
    on_step: Callable[[Ladder], None] | None = None,
) -> Ladder:
    """Add the missing effects one by one until nothing significant is left.

    Parameters
    ----------
    model : Model
    records, validation : sequence of Record
        What is fitted, and what the fit does not see.
    level : float
        Family-wise error rate of every step.
    criterion, effects, seed
        As in `diagnose`.
    most : int
        Most effects to add.
    ladder : Ladder, optional
        Go on from this one.
    progress : callable, optional
    on_step : callable, optional
        Called with the ladder after every step.

    Returns
    -------
    Ladder

    Raises
    ------
    InputError
        As `diagnose`.
    """
    if not 0.0 < level < 0.5:
        raise InputError(f"level = {level} is no error rate; choose something such as 0.01")
    start = model if ladder is None else ladder.model
    kind = choose_kind(start, records, criterion if ladder is None or criterion != "auto" else ladder.criterion)
    setting = with_common_whitening(prepare_setting(start, records, kind), start)
    parent = refit(setting, start)
    if ladder is None:
        fitted = with_stderr(parent, setting.records)
        first = Step(None, fitted, train=model_errors(fitted, records), validation=model_errors(fitted, validation))
        ladder = Ladder((first,), criterion=kind, level=level)
    ladder = replace(ladder, criterion=kind, level=level)
    tell = progress or (lambda share, text: None)
    held_out = None
    if validation:
        held_out = replace(prepare_setting(start, validation, kind), whiteners=setting.whiteners)
    diagnosis: Diagnosis | None = None
    while True:
        count = len(ladder.added)
        share = count / (count + 2.0)

        def report(part: float, text: str, low: float = share, width: float = 1.0 / (count + 3.0)) -> None:
            tell(low + width * part, text)

        diagnosis = diagnose_fitted(
            setting, parent, level=level, effects=effects, seed=seed, progress=report, rungs=True, held_out=held_out
        )
        if diagnosis.best is None or diagnosis.best_fit is None or count >= most:
            break
        ladder = _with_step(ladder, diagnosis, setting, records, validation)
        parent = diagnosis.best_fit
        ladder, parent = _without_needless(ladder, parent, setting, records, validation)
        if on_step is not None:
            on_step(ladder)
    tell(1.0, "done")
    return replace(
        ladder,
        verdict=diagnosis.verdict,
        candidates=diagnosis.candidates,
        untestable=diagnosis.untestable,
        findings=diagnosis.gate.findings,
        unknown=diagnosis.unknown,
    )


def _with_step(
    ladder: Ladder, diagnosis: Diagnosis, setting: Setting, records: Sequence[Record], validation: Sequence[Record]
) -> Ladder:
    best = diagnosis.best
    if best is None or best.model is None:
        return ladder
    # What a richer effect takes the place of is no rung of its own any more.
    steps = [s for s in ladder.steps if s.added is None or s.added.name != best.replaces or s.chosen_by == "user"]
    step = Step(
        added=best,
        model=best.model,
        set=diagnosis.set,
        p_value=best.p_value,
        train=model_errors(best.model, records),
        validation=model_errors(best.model, validation),
    )
    return replace(ladder, steps=(*steps, step), verdict=MISSING)


def _without_needless(
    ladder: Ladder, parent: Refit, setting: Setting, records: Sequence[Record], validation: Sequence[Record]
) -> tuple[Ladder, Refit]:
    """Take effects out again that a later one has made superfluous."""
    for step in ladder.steps[1:-1]:
        if step.added is None or step.added.name not in parent.model.effect_names or step.chosen_by == "user":
            continue
        smaller = parent.model.without_effect(step.added.name)
        try:
            without = refit(setting, smaller, None, parent)
        except IdloopError:
            continue
        if parent.log_likelihood - without.log_likelihood < _NEEDLESS:
            fitted = with_stderr(without, setting.records)
            kept = [s for s in ladder.steps if s is not step]
            last = kept[-1]
            if last.added is not None:
                added = replace(last.added, model=fitted, parameters=effect_parameters(fitted, last.added.name))
                last = replace(
                    last,
                    added=added,
                    model=fitted,
                    train=model_errors(fitted, records),
                    validation=model_errors(fitted, validation),
                )
            ladder, parent = replace(ladder, steps=(*kept[:-1], last)), without
    return ladder, parent


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def add_effect(
    ladder: Ladder,
    text: str,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    criterion: str | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Ladder:
    """Add the user's own choice instead of the proposed effect.

    Parameters
    ----------
    ladder : Ladder
    text : str
        ``effect@site`` or ``effect@site(parameter=value, ...)``.
    records, validation : sequence of Record
    criterion : str, optional
        That of the ladder when left out.
    seed : int
    progress : callable, optional

    Returns
    -------
    Ladder

    Raises
    ------
    InputError
        No such effect or site, or the model has it.
    """
    name, at, values = parse_effect(text)
    model = ladder.model
    tell = progress or (lambda share, text: None)
    tell(0.0, f"refitting with {name}@{at}")
    kind = choose_kind(model, records, criterion or ladder.criterion)
    setting = with_common_whitening(prepare_setting(model, records, kind), model)
    parent = refit(setting, model)
    trial = model.with_effect(name, at, **values)
    fit: Refit | None = None
    if not values:
        choice = [p for p in proposals(parent.model) if p.name == f"{name}@{at}"]
        if choice:
            diagnosis = diagnose_fitted(setting, parent, level=ladder.level, effects=[f"{name}@{at}"], seed=seed)
            found = diagnosis.candidates[0]
            if found.model is not None:
                return _chosen(ladder, found, found.model, records, validation)
    fit = refit(setting, trial, None, parent)
    fitted = with_stderr(fit, setting.records)
    effect = next(a.effect for a in fitted.effects if a.name == f"{name}@{at}")
    candidate = Candidate(
        effect=name,
        at=at,
        testable="yes",
        why="chosen by the user",
        text=effect.text,
        gain=fit.log_likelihood - parent.log_likelihood,
        parameters=effect_parameters(fitted, f"{name}@{at}"),
        model=fitted,
    )
    return _chosen(ladder, candidate, fitted, records, validation)


def _chosen(
    ladder: Ladder, candidate: Candidate, model: Model, records: Sequence[Record], validation: Sequence[Record]
) -> Ladder:
    step = Step(
        added=candidate,
        model=model,
        set=(candidate.name,),
        p_value=candidate.p_value,
        chosen_by="user",
        train=model_errors(model, records),
        validation=model_errors(model, validation),
    )
    return replace(ladder, steps=(*ladder.steps, step), verdict=MISSING)
