"""What the data of a ladder cannot show, how small an absent effect must be, what is significant and not added."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from idloop.diagnosis.search.step import MISSING

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Ladder


def undetectable(ladder: Ladder) -> dict[str, str]:
    """Effects that the data cannot show, and why.

    An effect that the model has, that one of the model contains, or that ties with one of it, is not among them: what
    is left of it beside the other says nothing about what the data could show. Nor is one that was significant and was
    not added: it is listed with the reason.

    Returns: why, by ``effect@site``; empty words where that is not known any more.
    """
    why = {candidate.name: candidate.why for candidate in ladder.candidates}
    shown = {*_found(ladder), *_significant(ladder)}
    return {name: why.get(name, "") for name in ladder.untestable if name not in shown}


def detection_limits(ladder: Ladder) -> dict[str, str]:
    """Effects that were not found, and the size at which they would have been, for a table.

    Returns: size by ``effect@site``, such as "width ≥ 0.012 V"; without those that `undetectable` lists.
    """
    hidden = {*_found(ladder), *_significant(ladder), *ladder.untestable}
    return {name: limit.short for name, limit in ladder.limits.items() if limit.short and name not in hidden}


def significant_not_added(ladder: Ladder) -> list[Candidate]:
    """Effects that are significant on the fitted data and that the ladder did not add, without having passed them over.

    Returns: of those that were refitted last, the surest first.
    """
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
    open_ = significant_not_added(ladder) if ladder.verdict == MISSING else []
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
