"""Which effects a ladder or a diagnosis chose from, where that was not the whole catalogue."""

from __future__ import annotations

from typing import TYPE_CHECKING

from idloop.diagnosis.ladder import Ladder
from idloop.diagnosis.screening.proposals import proposals
from idloop.reporting.effect_names import words
from idloop.spelling import joined_names

if TYPE_CHECKING:
    from idloop.diagnosis import Diagnosis

# So many names are read; of more the number says enough.
_NAMED = 6


def only_tried(result: Ladder | Diagnosis) -> tuple[str, ...]:
    """Effects that were looked for in the end, where the catalogue has more for this machine.

    Returns
    -------
    tuple of str
        As words, without their sites where every site was looked at; empty for the whole catalogue, and where the
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
    return tuple(dict.fromkeys(words(name) for name in named))


def only_words(result: Ladder | Diagnosis) -> str:
    """Say what was looked for, to go on a sentence: "only backlash and dead zone were looked for"; else empty."""
    names = only_tried(result)
    if not names:
        return ""
    what = joined_names(list(names)) if len(names) <= _NAMED else f"{len(names)} effects"
    return f"only {what} {'were' if len(names) > 1 else 'was'} looked for, not the whole catalogue"
