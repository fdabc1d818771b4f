"""Which effects a model could still have: the catalogue, laid over the model's sites."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from idloop.errors import InputError
from idloop.physics.conditions import condition_name
from idloop.physics.effect import OUTPUT, Effect, catalogue, unknown_effect
from idloop.physics.model import Model, effect_name, values_of
from idloop.physics.schema import Value
from idloop.physics.trial import Scales, Trial


@dataclass(frozen=True)
class Proposal:
    """An effect at a site that a model does not have yet."""

    effect: Effect
    at: str
    base: Model  # the model that it is added to, without the effect that it replaces
    replaces: str | None = None  # that effect, as ``effect@site``
    held: tuple[str, ...] = ()  # parameters that stay neutral, because another effect of the model does that part
    plain: Trial | None = None  # values of the simple form that the model has, where this is the full form

    @property
    def number(self) -> int:
        """Which one it is of an effect that may act several times at a site."""
        return self.base.next_number(self.effect, self.at)

    @property
    def name(self) -> str:
        """Name in the model that has it, such as ``effect@site``."""
        return effect_name(self.effect.name, self.at, self.number)

    @property
    def whole_numbers(self) -> tuple[str, ...]:
        """Parameters that are whole numbers."""
        return tuple(spec.name for spec in self.effect.parameters if spec.integer)

    def alternatives(self, scales: Scales) -> list[list[Trial]]:
        """Values to try, see `idloop.physics.trial`."""
        effect = self.effect
        if self.plain is not None and effect.further is not None:
            found = [list(group) for group in effect.further(scales, self.plain)]
        elif effect.trials is not None:
            found = [list(group) for group in effect.trials(scales)]
        elif effect.parameters:
            found = [[_generic_trial(effect, scales, share)] for share in (0.02, 0.1, 0.4)]
        else:
            found = [[{}]]
        return [[self.inside(trial) for trial in group] for group in found]

    def inside(self, trial: Trial) -> Trial:
        """The nearest values within the parameters' bounds."""
        values = {}
        for name, value in trial.items():
            spec = self.effect.spec(name)
            values[name] = spec.neutral if name in self.held else min(max(value, spec.min), spec.max)
        return values

    @property
    def one_sided(self) -> bool:
        """Whether the effect can only act in one sense, because its neutral value is a bound."""
        if self.replaces is not None:
            return False
        searched = (spec for spec in self.effect.parameters if spec.estimated and not spec.held)
        return any(spec.neutral == spec.min or not math.isfinite(spec.neutral) for spec in searched)

    @property
    def beyond(self) -> set[str]:
        """Parameters that it has beyond those of the simpler effect that it replaces; all where it replaces none."""
        if self.plain is not None:
            return {p.name for p in self.effect.parameters if p.optional or p.held}
        simpler = (self.replaces or "").partition("@")[0]
        return {p.name for p in self.effect.parameters} - set(self.effect.contains.get(simpler, {}).values())

    def weaker(self, trial: Trial, share: float) -> Trial:
        """Values at a share of the effect's strength; unchanged for an effect without a strength."""
        values = dict(trial)
        name = self.effect.strength
        if name and name in values and name not in self.held:
            neutral = self.effect.spec(name).neutral
            values[name] = neutral + share * (values[name] - neutral)
        return values

    def model(self, values: Trial) -> Model:
        """The base with this effect at the given values; its estimated parameters are free."""
        entries: dict[str, Value] = {}
        for spec in self.effect.parameters:
            if spec.optional and spec.name not in values:
                continue
            free = spec.estimated and not ((spec.held and self.plain is None) or spec.name in self.held)
            entries[spec.name] = Value(value=float(values.get(spec.name, spec.start)), free=free)
        return self.base.with_entry(self.effect.name, self.at, entries)


def _generic_trial(effect: Effect, scales: Scales, share: float) -> Trial:
    """Values for an effect without trials of its own: a share of the typical size in its unit."""
    trial = {}
    for spec in effect.parameters:
        own = spec.integer or spec.held or spec.start != spec.neutral
        trial[spec.name] = spec.start if own else share * scales.unit(spec.unit)
    return trial


def proposals(
    model: Model,
    only: Sequence[str] | None = None,
    conditions: Mapping[str, str] | None = None,
    between_harmonics: Collection[str] = (),
) -> list[Proposal]:
    """All effects that could be added to a model, of some names (``effect`` or ``effect@site``) only where given.

    Without those that the model or its free parameters have, those that one of its effects contains, and those that
    depend on a condition that not all records have (names and units; None: not known). Along an angle, any period is
    for the bodies only whose force repeats between two harmonics of the turn. An `InputError` for a name that is
    unknown, or that depends on a condition that was not recorded.
    """
    known = catalogue(*model.effect_folders)
    wanted = None if only is None else [re.sub(r"#\d+", "", text) for text in only]
    for text in wanted or ():
        name, _, at = text.partition("@")
        if name not in known:
            raise unknown_effect(name, known)
        if at:
            model.site_kind(at)
        if conditions is not None:
            _check_recorded(model, known[name], at, conditions)
    found = []
    for effect in (one for several in known.values() for one in several):
        for at in model.sites(effect.site):
            asked = wanted is None or effect.name in wanted or f"{effect.name}@{at}" in wanted
            if effect.any_period and model.units.position == "rad" and at not in between_harmonics:
                continue
            if asked and _recorded(effect, at, conditions or {}) and _fits(model, effect, at):
                found.append(_propose(model, effect, at))
    return [proposal for proposal in found if proposal is not None]


def _recorded(effect: Effect, at: str, conditions: Mapping[str, str]) -> bool:
    """Whether the condition was recorded that an effect depends on, if it does on any."""
    if not effect.condition:
        return True
    return conditions.get(condition_name((at, effect.condition), conditions)) in (effect.condition_unit, "")


def _check_recorded(model: Model, asked: Sequence[Effect], at: str, conditions: Mapping[str, str]) -> None:
    """Refuse an effect by name that depends on a condition that was not recorded for any site."""
    sites = [(effect, site) for effect in asked for site in model.sites(effect.site) if at in ("", site)]
    if not sites or any(_recorded(effect, site, conditions) for effect, site in sites):
        return
    effect = sites[0][0]
    raise InputError(
        f"effect {effect.name} depends on the condition {effect.condition!r} in {effect.condition_unit}, which not all"
        " records hold: record it, and name it under `conditions:` of the model or mapping file"
    )


def _fits(model: Model, effect: Effect, at: str) -> bool:
    """Whether an effect applies at a site of a model that does not have it, or only in its simple form."""
    name = f"{effect.name}@{at}"
    if name in model.effect_names and not effect.several:
        optional = [f"{name}.{spec.name}" for spec in effect.parameters if spec.optional]
        if effect.further is None or any(one in model.values for one in optional):
            return False
    if effect.site == OUTPUT and next(o for o in model.outputs if o.site == at).field not in effect.outputs:
        return False
    if effect.needs_angle and model.units.position != "rad":
        return False
    if effect.of_loop and model.loop is None:
        return False
    # A sensor's resolution is read off the data, without a fit.
    return f"{at}.{effect.site_parameter}" not in model.free and not effect.resolution


def _propose(model: Model, effect: Effect, at: str) -> Proposal | None:
    """An effect beside those of its site, or instead of one of them; None where one of them contains it."""
    beside = [active for active in model.effects if active.at == at and active.effect.site == effect.site]
    own = None if effect.several else next((active for active in beside if active.effect.name == effect.name), None)
    if own is not None:
        values = values_of(own, model.values)
        return Proposal(effect, at, model.without_effect(own.name, making_room=True), own.name, plain=values)
    if any(effect.name in active.effect.contains for active in beside):
        return None
    for active in beside:
        if active.effect.name in effect.contains:
            return Proposal(effect, at, model.without_effect(active.name, making_room=True), active.name)
    for active in beside:
        shared = set(active.effect.contains) & set(effect.contains)
        if not shared:
            continue
        part = min(shared)
        if effect.separable:
            return Proposal(effect, at, model, held=tuple(effect.contains[part].values()))
        if active.effect.separable:
            # The effect of the model gives the common part to the new one.
            names = [f"{active.name}.{name}" for name in active.effect.contains[part].values()]
            base = model.with_values(dict.fromkeys(names, 0.0)).with_free(n for n in model.free if n not in names)
            return Proposal(effect, at, base)
        return None
    return Proposal(effect, at, model)
