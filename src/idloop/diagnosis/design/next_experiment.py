"""The next experiment after a diagnosis or a ladder: for effects that tie, then for those that the data cannot show."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from idloop.diagnosis.design.effect_question import effect_rivals
from idloop.diagnosis.design.limits import Limits
from idloop.diagnosis.design.suggest import Suggestion, suggest
from idloop.diagnosis.equivalence.equivalent_effects import find_equivalent_effects, without_equivalents
from idloop.diagnosis.options import Progress, silent
from idloop.errors import IdloopError
from idloop.physics.effect import catalogue
from idloop.physics.model import effect_and_site, effect_name
from idloop.spelling import joined_names

if TYPE_CHECKING:
    from idloop.diagnosis.diagnosis import Diagnosis
    from idloop.diagnosis.ladder import Ladder
    from idloop.physics import Model
    from idloop.physics.effect import Effect
    from idloop.records import Record


# Rivals at most: each pair costs, and the last ones of a long set hardly differ from the others.
_MOST_RIVALS = 4
_MOST_UNSEEN = 6
# The command must be allowed to go this much beyond what it was, to look for what is there.
_WIDER = 1.2


@dataclass(frozen=True)
class Question:
    """What an experiment is to decide."""

    rivals: tuple[Model, ...]  # fitted to the data so far
    text: str


def suggest_next(
    found: Diagnosis | Ladder,
    records: Sequence[Record],
    limits: Limits | None = None,
    *,
    duration: float | None = None,
    seed: int = 0,
    start: float | None = None,
    progress: Progress | None = None,
) -> Suggestion | None:
    """Choose the experiment that decides what a diagnosis or a ladder has left open.

    Effects that tie come first. Where none do, effects that the data cannot show are asked for, the everyday ones
    first, all in one experiment.

    Parameters
    ----------
    found : Diagnosis or Ladder
    records : sequence of Record
        The data that it came from.
    limits, duration, seed, start, progress
        As in `suggest`.

    Returns
    -------
    Suggestion or None
        None when nothing is open.

    Raises
    ------
    InputError
        As `suggest`.
    """
    report = progress or silent
    asked = open_question(found, records, seed=seed, progress=lambda share, text: report(0.3 * share, text))
    options: dict[str, Any] = {
        "duration": duration, "seed": seed, "start": start, "criterion": found.criterion,
    }  # fmt: skip

    def later(share: float, text: str) -> None:
        report(0.3 + 0.7 * share, text)

    if asked is not None:
        answer = suggest(asked.rivals, records, limits, progress=later, **options)
        return replace(answer, text=f"{asked.text}; {answer.text}")
    return _for_untestable(found, records, limits or Limits(), options, later)


def open_question(
    found: Diagnosis | Ladder, records: Sequence[Record], *, seed: int = 0, progress: Progress | None = None
) -> Question | None:
    """The latest tie as models, each with one of the tied effects fitted; None without a tie.

    Of equivalent effects only the first counts: no experiment can separate them.
    """
    from idloop.diagnosis.diagnose import diagnose
    from idloop.diagnosis.diagnosis import Diagnosis

    if isinstance(found, Diagnosis):
        # Of a pair, either effect may be tied.
        tied = [_distinct(found.model, rung.set, rung.added.replaces) for rung in found.rungs]
        return _question(found, next((names for names in tied if len(names) > 1), found.set[:1]))
    model = found.model
    for step in reversed(found.steps):
        if step.added is None or step.added.name not in model.effect_names:
            continue
        names = _distinct(model, (step.added.name, *step.set), step.added.replaces)
        if len(names) < 2:
            continue
        without = model.without_effect(step.added.name)
        again = diagnose(
            without, records, level=found.level, criterion=found.criterion, effects=names, seed=seed, progress=progress
        )
        # More may be known by now than when the step was taken.
        return _question(again, _distinct(without, again.set, None))
    return None


def _distinct(model: Model, tied: Sequence[str], replaces: str | None) -> tuple[str, ...]:
    """Tied effects without those that are the same equation as one before them."""
    return without_equivalents(tuple(dict.fromkeys(tied)), find_equivalent_effects(model, tied, replaces))


def _question(found: Diagnosis, names: Sequence[str]) -> Question | None:
    models = [c.model for c in found.candidates if c.name in names and c.model is not None][:_MOST_RIVALS]
    if len(models) < 2:
        return None
    return Question(tuple(models), f"this data cannot tell {joined_names(list(names))} apart")


def _for_untestable(
    found: Diagnosis | Ladder,
    records: Sequence[Record],
    limits: Limits,
    options: dict[str, Any],
    progress: Progress,
) -> Suggestion | None:
    """The experiment that shows most of the effects that the data cannot show."""
    start = _model_found(found)
    known = catalogue(*start.effect_folders)

    def at(name: str) -> Effect:
        kind, site = effect_and_site(name)
        return next(effect for effect in known[kind] if effect.site == start.site_kind(site))

    seen, allowed = Limits().completed(start, records), limits.completed(start, records)
    further = seen.command is not None and allowed.command is not None and allowed.command > _WIDER * seen.command
    unseen = []
    for name in found.untestable:
        effect = at(name)
        # A sensor's resolution shows without an experiment.
        if not (effect.hidden_by_start or effect.resolution) and (further or not effect.from_a_level):
            unseen.append(name)
    unseen += [name for name in _over_a_turn(start, seen, allowed) if name not in unseen]
    models: dict[str, Model] = {}
    for name in sorted(unseen, key=lambda name: at(name).suggest_order):
        if len(models) == _MOST_UNSEEN:
            break
        try:
            base, extended = effect_rivals(start, name, records, limits)
        except IdloopError:
            continue
        if base.effect_names == start.effect_names:  # else it would replace a known effect
            models[name] = extended
    if not models:
        return None
    answer = suggest([start, *models.values()], records, limits, against_first=True, progress=progress, **options)
    return replace(answer, text=f"this data cannot show {joined_names(list(models))}; {answer.text}")


def _model_found(found: Diagnosis | Ladder) -> Model:
    """The model with the effects that a diagnosis has found."""
    from idloop.diagnosis.diagnosis import Diagnosis

    if not isinstance(found, Diagnosis) or found.reached is None:
        return found.model
    return found.reached


def _over_a_turn(model: Model, seen: Limits, allowed: Limits) -> list[str]:
    """What shows over a turn only, where less than one was covered and the limits allow it."""
    if model.units.position != "rad" or seen.position is None or allowed.position is None:
        return []
    covered, free = (high - low for low, high in (seen.position, allowed.position))
    if not covered < 2.0 * math.pi <= free:
        return []
    effects = (e for several in catalogue(*model.effect_folders).values() for e in several if e.whole_turn)
    # Of the bodies, the driven one: its way is what the limits are about.
    names = (effect_name(effect.name, at) for effect in effects for at in model.sites(effect.site)[:1])
    return [name for name in names if name not in model.effect_names]
