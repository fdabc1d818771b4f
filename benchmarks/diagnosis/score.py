"""What a ladder got right and wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from case import Case
from twins import all_pieces, pieces, same


@dataclass(frozen=True)
class Rung:
    """One effect that the ladder added: its name, the set that came with it, and what it replaced."""

    name: str
    set: tuple[str, ...]
    replaces: str | None
    p_value: float | None
    gain: float | None


def rungs(ladder: Any) -> tuple[Rung, ...]:
    """The added effects of an `idloop.diagnosis.Ladder`."""
    found = []
    for step in ladder.steps:
        if step.added is None:
            continue
        names = tuple(dict.fromkeys((step.added.name, *step.set)))
        gain = step.added.gain
        found.append(
            Rung(step.added.name, names, step.added.replaces, step.p_value, None if math.isnan(gain) else float(gain))
        )
    return tuple(found)


@dataclass(frozen=True)
class Score:
    """Judgement of one case.

    Attributes
    ----------
    found : tuple of bool
        For each hidden effect, whether some set contains it (or its pieces).
    exact : bool
        Every set that holds a hidden effect holds nothing else, twins apart.
    false : tuple of str
        Added effects whose set holds nothing that is there; one that a later one replaced is forgiven. What a
        realistic machine has beside what it hides is there.
    """

    found: tuple[bool, ...]
    exact: bool
    false: tuple[str, ...]


def score(case: Case, model: Any, added: Sequence[Rung]) -> Score:
    """Judge the added effects against what is hidden.

    Parameters
    ----------
    case : Case
    model : Model
        The start model.
    added : sequence of Rung
    """
    truth = [pieces(case, model, name) for name in case.truth]
    wanted = frozenset().union(*truth) if truth else frozenset()
    # rounding that is part of the machine is there, though nobody asked for it
    there = wanted | frozenset(f"sensor_quantisation@{site}" for site in case.quantisation)
    if case.nuisances is not None:
        sites = tuple(output.site for output in model.outputs)
        there |= all_pieces(case, model, case.nuisances.names(model.bodies, sites))
    covered: frozenset[str] = frozenset()
    exact, false = True, []
    replaced = {rung.replaces for rung in added if rung.replaces}
    for rung in added:
        hits = [name for name in rung.set if pieces(case, model, name) & there]
        if not hits and pieces(case, model, rung.name):
            if rung.name not in replaced:
                false.append(rung.name)
            continue
        # friction is in the model already: then uneven friction and a constant are one and the same
        if hits and not same(case, model, rung.set, covered):
            exact = False
        covered |= all_pieces(case, model, hits)
    found = tuple(part <= covered and bool(part) for part in truth)
    return Score(found, exact and all(found), tuple(false))
