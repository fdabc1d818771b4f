"""Equivalent effects: they have the same equation, so that no motion can separate them; a check by hand can."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

from idloop.physics.effect import BODY, INPUT, Effect, catalogue
from idloop.physics.model import effect_and_site, effect_name
from idloop.spelling import joined_names

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.physics import Model

# Between effects that together are equivalent to one.
_AND = " + "


@dataclass(frozen=True)
class EquivalentEffects:
    """Effects that have the same equation in a model."""

    names: tuple[str, ...]  # ``effect@site``, two or more
    checks: tuple[str, ...]  # that separate them by hand

    @property
    def parts(self) -> frozenset[str]:
        """All single effects in it, ``effect@site``."""
        return frozenset(part for name in self.names for part in name.split(_AND))

    @property
    def text(self) -> str:
        """One sentence, without the checks."""
        return f"no motion can tell {joined_names(self.names)} apart: they are one equation in this model"

    @property
    def lines(self) -> list[str]:
        """For the terminal."""
        return [self.text, *(f"  by hand: {check}" for check in self.checks)]

    def to_dict(self) -> dict[str, object]:
        """Plain values for JSON."""
        return {"effects": list(self.names), "checks": list(self.checks)}


def find_equivalent_effects(
    model: Model, names: Sequence[str], replaces: str | None = None
) -> tuple[EquivalentEffects, ...]:
    """Groups of equivalent effects among some tied ones, ``effect@site``, in their order, or of one alone.

    Then equivalents that are not among them; two effects that are equivalent to one are written ``effect@site +
    effect@site``. `replaces` is the effect of the model before that one of them replaced.
    """
    forms = _Forms(model)
    rest = {name for name in (*model.effect_names, replaces or "") if name and name not in names}
    groups: dict[frozenset[str], list[str]] = {}
    for name in dict.fromkeys(names):
        groups.setdefault(forms.pieces({*rest, name}), []).append(name)
    for spelt in dict.fromkeys(other for name in names for other in forms.combinations(name, rest)):
        group = groups.get(forms.pieces({*rest, *spelt.split(_AND)}), [])
        if group and spelt not in group:
            group.append(spelt)
    return tuple(EquivalentEffects(tuple(group), forms.checks(group)) for group in groups.values() if len(group) > 1)


def equivalent_effects_of_ladder(ladder: Ladder) -> tuple[EquivalentEffects, ...]:
    """Equivalent effects among the ties of a ladder in its last model, the effect of the model first."""
    found: list[EquivalentEffects] = []
    for step in ladder.steps:
        if step.added is not None and step.added.name in ladder.model.effect_names:
            tied = (step.added.name, *ladder.rivals(step))
            found += find_equivalent_effects(ladder.model, tied, step.added.replaces)
    return tuple(found)


def without_equivalents(names: Sequence[str], twins: Iterable[EquivalentEffects]) -> tuple[str, ...]:
    """The names without those that are equivalent to one before them."""
    needless = {name for group in twins for name in group.names[1:]}
    return tuple(name for name in names if name not in needless)


def equivalent_rivals(models: Sequence[Model]) -> tuple[tuple[int, ...], EquivalentEffects | None]:
    """Indices of fitted rival models that are not equivalent to one before them, and the first group that is.

    The group is named by the effects that not all models have.
    """
    common = set(models[0].effect_names).intersection(*(model.effect_names for model in models[1:]))
    kinds: dict[tuple[frozenset[str], frozenset[str]], list[int]] = {}
    for index, model in enumerate(models):
        effects = tuple(f"{name}." for name in model.effect_names)
        others = frozenset(name for name in model.free if not name.startswith(effects))
        kinds.setdefault((_Forms(model).pieces(set(model.effect_names)), others), []).append(index)
    for group in kinds.values():
        own = [_AND.join(n for n in models[i].effect_names if n not in common) for i in group]
        if len(group) > 1 and len(set(own)) == len(group):
            kept = tuple(sorted({*range(len(models))} - set(group[1:])))
            return kept, EquivalentEffects(tuple(own), _Forms(models[group[0]]).checks(own))
    return tuple(range(len(models))), None


class _Forms:
    """Effects of a model in a common form, by the facts in their files."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._known = catalogue(*model.effect_folders)

    def pieces(self, names: set[str]) -> frozenset[str]:
        """Effects that are equivalent to all of these together, none of them to another one."""
        return frozenset(piece for name in names for piece in self._resolved(name, names, ()))

    def combinations(self, name: str, rest: set[str]) -> list[str]:
        """Combinations equivalent to an effect that is two or more at once, beside the effects of a model."""
        parts = self._parts(name, {*rest, name})
        if len(parts) < 2:
            return []
        choices = []
        for part in parts:
            if effect_and_site(part)[0] in self._effect(name).contains:
                # It replaces this one.
                choices.append(["" if part in rest else part])
            else:
                choices.append([one for one in (part, *self._others(part, rest)) if one not in rest])
        return [_AND.join(filter(None, spelt)) for spelt in product(*choices) if any(spelt)]

    def checks(self, names: Iterable[str]) -> tuple[str, ...]:
        """Checks that separate effects by hand, the simplest first, one for each pair that others do not separate."""
        effects = {one.name: one for name in names for one in map(self._effect, filter(None, name.split(_AND)))}
        separated: set[str] = set()
        found = []
        for effect in sorted(effects.values(), key=lambda one: (len(one.same_as), one.name)):
            for other, check in effect.by_hand.items():
                pair = {effect.name, other}
                if other in effects and not pair <= separated:
                    found.append(check)
                    separated |= pair
        return tuple(found) or ("measure the one or the other by itself",)

    def _effect(self, name: str) -> Effect:
        effect, at = effect_and_site(name)
        kind = self.model.site_kind(at)
        return next(one for one in self._known[effect] if one.site == kind)

    def _resolved(self, name: str, names: set[str], above: tuple[str, ...]) -> set[str]:
        if name in above:  # each of two names the other
            return {min(above)}
        parts = self._parts(name, names)
        return {piece for part in parts for piece in self._resolved(part, names - {name}, (*above, name))} or {name}

    def _parts(self, name: str, names: set[str]) -> tuple[str, ...]:
        """The effects that one is equivalent to beside others; empty where there are none, or it is unknown."""
        if effect_and_site(name)[0] not in self._known:
            return ()
        effect, (_, at) = self._effect(name), effect_and_site(name)
        places = [self._place(effect, at, part, names) for part in effect.same_as]
        if None in places:
            return ()
        return tuple(f"{part}@{place}" for part, place in zip(effect.same_as, places, strict=True))

    def _place(self, effect: Effect, at: str, part: str, names: set[str]) -> str | None:
        """Site at which a part of an effect has the same equation; None where it differs in this model."""
        parts = {one.site: one for one in self._known[part]}
        same = parts.get(effect.site)
        if same is not None:
            return at if effect.site == BODY or self._leave_constants(at, (effect, same), names) else None
        if effect.site == INPUT and BODY in parts:
            # Gain times a constant is a constant force on the driven body.
            return self.model.bodies[0] if self._leave_constants(at, (effect,), names) else None
        if effect.delay and INPUT in parts and parts[INPUT].delay and len(self.model.outputs) == 1:
            # Nothing between command and sensor depends on time: with one sensor the order does not matter.
            return INPUT
        return None

    def _leave_constants(self, at: str, ends: tuple[Effect, ...], names: set[str]) -> bool:
        """Whether the effects between two of a site, or behind one, pass constants unchanged."""
        chain = [self._effect(name) for name in names if effect_and_site(name)[1] == at]
        low = min(one.order for one in ends)
        high = max(one.order for one in ends) if len(ends) > 1 else math.inf
        return all(one.passes_constants for one in chain if one not in ends and low <= one.order <= high)

    def _others(self, part: str, rest: set[str]) -> Iterator[str]:
        """Effects that are equivalent to one alone."""
        for effect in (one for several in self._known.values() for one in several if len(one.same_as) == 1):
            for at in self.model.sites(effect.site):
                name = effect_name(effect.name, at)
                if self._parts(name, {*rest, name}) == (part,):
                    yield name
