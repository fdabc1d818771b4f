"""Effects that are one and the same equation: no motion tells them apart, a check by hand does."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from idloop.diagnose.suggest_words import listed
from idloop.physics.effect import INPUT, find_effect

if TYPE_CHECKING:
    from idloop.diagnose import Ladder
    from idloop.physics import Model

# Between effects that stand together for one.
_AND = " + "
# Behind these a constant of the command stays a constant of the force.
_LEAVE_A_CONSTANT = frozenset({"input_delay", "actuator_lag"})
# What to do where motion cannot tell, by the effects that it tells apart.
_CHECKS: tuple[tuple[frozenset[str], str], ...] = (
    (
        frozenset({"input_offset", "load_torque"}),
        "with the load off and the command at zero, an amplifier's offset still turns the motor, a load does not",
    ),
    (
        frozenset({"asymmetric_friction", "load_torque"}),
        "mount the axis the other way round or take the load off, a load turns its sign or goes, friction stays",
    ),
    (
        frozenset({"asymmetric_friction", "input_offset"}),
        "zero the amplifier, an offset goes, friction stays",
    ),
    (
        frozenset({"input_delay", "sensor_delay"}),
        "watch the drive's current beside the command, a delay of the input is there as well, one of the sensor is not",
    ),
)


@dataclass(frozen=True)
class Twins:
    """Effects that are one equation in a model.

    Attributes
    ----------
    names : tuple of str
        ``effect@site``, two or more.
    checks : tuple of str
        What tells them apart by hand.
    """

    names: tuple[str, ...]
    checks: tuple[str, ...]

    @property
    def parts(self) -> frozenset[str]:
        """All single effects in it, ``effect@site``."""
        return frozenset(part for name in self.names for part in name.split(_AND))

    @property
    def text(self) -> str:
        """One sentence for the reader, without the checks."""
        return f"no motion can tell {listed(self.names)} apart: they are one equation in this model"

    @property
    def lines(self) -> list[str]:
        """For the terminal."""
        return [self.text, *(f"  by hand: {check}" for check in self.checks)]

    def to_dict(self) -> dict[str, object]:
        """Plain values for JSON."""
        return {"effects": list(self.names), "checks": list(self.checks)}


def find_twins(model: Model, names: Sequence[str], replaces: str | None = None) -> tuple[Twins, ...]:
    """Groups of effects that are one equation.

    Parameters
    ----------
    model : Model
        With or without one of them.
    names : sequence of str
        Effects that fit alike, ``effect@site``, or one alone.
    replaces : str, optional
        Effect of the model before that one of them took the place of.

    Returns
    -------
    tuple of Twins
        In the order of `names`, then what is one equation with them whatever a fit says, two effects that stand for
        one as ``effect@site + effect@site``. Empty where data of another kind could tell them apart.
    """
    rest = {name for name in (*model.effect_names, replaces or "") if name and name not in names}
    groups: dict[frozenset[str], list[str]] = {}
    for name in dict.fromkeys(names):
        groups.setdefault(_pieces(model, {*rest, name}), []).append(name)
    for spelt in dict.fromkeys(other for name in names for other in _spelt_out(model, name, rest)):
        group = groups.get(_pieces(model, {*rest, *spelt.split(_AND)}), [])
        if group and spelt not in group:
            group.append(spelt)
    return tuple(Twins(tuple(group), _checks(group)) for group in groups.values() if len(group) > 1)


def ladder_twins(ladder: Ladder) -> tuple[Twins, ...]:
    """Groups among the ties of a ladder that are one equation in its last model.

    Parameters
    ----------
    ladder : Ladder

    Returns
    -------
    tuple of Twins
        The effect that the model has first.
    """
    found: list[Twins] = []
    for step in ladder.steps:
        if step.added is not None and step.added.name in ladder.model.effect_names:
            tied = (step.added.name, *ladder.rivals(step))
            found += find_twins(ladder.model, tied, step.added.replaces)
    return tuple(found)


def one_of_each(names: Sequence[str], twins: Iterable[Twins]) -> tuple[str, ...]:
    """The names without those that are the same equation as one before them."""
    needless = {name for group in twins for name in group.names[1:]}
    return tuple(name for name in names if name not in needless)


def rival_twins(models: Sequence[Model]) -> tuple[tuple[int, ...], Twins | None]:
    """Rival models that are not one equation with one before them, and those that are.

    Parameters
    ----------
    models : sequence of Model
        With the same signals, fitted.

    Returns
    -------
    indices : tuple of int
        Of one model of each kind.
    twins : Twins or None
        The first group of models that are one, by the effects that not all models have.
    """
    common = set(models[0].effect_names).intersection(*(model.effect_names for model in models[1:]))
    kinds: dict[tuple[frozenset[str], frozenset[str]], list[int]] = {}
    for index, model in enumerate(models):
        others = frozenset(p.name for p in model.parameters if not _of_an_effect(model, p.name) and p.free)
        kinds.setdefault((_pieces(model, set(model.effect_names)), others), []).append(index)
    for group in kinds.values():
        own = [_AND.join(n for n in models[i].effect_names if n not in common) for i in group]
        if len(group) > 1 and len(set(own)) == len(group):
            kept = tuple(sorted({*range(len(models))} - set(group[1:])))
            return kept, Twins(tuple(own), _checks(own))
    return tuple(range(len(models))), None


def _spelt_out(model: Model, name: str, rest: set[str]) -> list[str]:
    """What friction that differs by direction is, beside an effect that the model has: friction and a constant."""
    effect, _, at = name.partition("@")
    if effect != "asymmetric_friction":
        return []
    constants = [f"load_torque@{at}", *([f"input_offset@{INPUT}"] if at == model.bodies[0] else [])]
    plain = f"coulomb_friction@{at}"
    return [c if plain in rest else f"{plain}{_AND}{c}" for c in constants if c not in rest]


def _of_an_effect(model: Model, parameter: str) -> bool:
    return any(parameter.startswith(f"{name}.") for name in model.effect_names)


def _pieces(model: Model, names: set[str]) -> frozenset[str]:
    """Effects brought to a common form."""
    found: set[str] = set()
    for name in names:
        effect, _, at = name.partition("@")
        if effect == "asymmetric_friction":
            # level (1 + ratio sign v) sign v = level sign v + level ratio, at rest too: friction and a constant
            found |= {f"coulomb_friction@{at}", f"load_torque@{at}"}
        elif effect == "input_offset" and _constant_arrives(model, names):
            # gain (u + offset) = gain u + constant: a constant force on the driven body
            found.add(f"load_torque@{model.bodies[0]}")
        elif effect == "sensor_delay" and len(model.outputs) == 1:
            # Nothing between command and sensor depends on time: with one sensor the order does not matter.
            found.add("input_delay@input")
        else:
            found.add(name)
    return frozenset(found)


def _constant_arrives(model: Model, names: set[str]) -> bool:
    """Whether what stands between an offset of the command and the force leaves a constant alone."""
    order = find_effect("input_offset", INPUT).order
    for name in names:
        effect, _, at = name.partition("@")
        if at != INPUT or effect in _LEAVE_A_CONSTANT:
            continue
        if find_effect(effect, INPUT, *model.effect_folders).order > order:
            return False
    return True


def _checks(names: Iterable[str]) -> tuple[str, ...]:
    kinds = {part.partition("@")[0] for name in names for part in name.split(_AND)}
    told: set[str] = set()
    found = []
    for pair, text in _CHECKS:
        if pair <= kinds and not pair <= told:
            found.append(text)
            told |= pair
    return tuple(found) or ("measure the one or the other by itself",)
