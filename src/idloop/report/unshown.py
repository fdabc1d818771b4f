"""What the data of a ladder cannot show, without what the ladder has found after all."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from idloop.diagnose import Ladder


def unshown(ladder: Ladder) -> dict[str, str]:
    """Effects that the data cannot show, and why.

    An effect that the model has, that one of the model contains, or that ties with one of it, is not among them: what
    is left of it beside the other says nothing about what the data could show.

    Parameters
    ----------
    ladder : Ladder

    Returns
    -------
    dict
        Why, by ``effect@site``; empty words where that is not known any more.
    """
    model = ladder.model
    found = {*model.effect_names, *ladder.added}
    for active in model.effects:
        found.update(f"{inner}@{active.at}" for inner in active.effect.contains)
    for step in ladder.steps:
        found.update(step.set)
    why = {candidate.name: candidate.why for candidate in ladder.candidates}
    return {name: why.get(name, "") for name in ladder.untestable if name not in found}
