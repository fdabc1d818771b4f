"""A model as bare numbers, for simulators that share no code with idloop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class PlainOutput:
    """A sensor: body (after compliance has split some), whether it shows the velocity, scale."""

    site: str
    body: int
    velocity: bool
    scale: float


@dataclass(frozen=True)
class PlainEffect:
    """An effect: name, kind of site, index of the body, coupling or output, and its values."""

    name: str
    kind: str
    index: int
    values: dict[str, float]


@dataclass(frozen=True)
class Plain:
    """A chain of bodies in SI units.

    Attributes
    ----------
    inertia, viscous : list of float
        One per body.
    stiffness, damping : list of float
        One per coupling.
    gain : float
        Force per unit of command.
    outputs : list of PlainOutput
    effects : list of PlainEffect
        Without ``compliance``, which is a further body here.
    """

    inertia: list[float]
    viscous: list[float]
    stiffness: list[float]
    damping: list[float]
    gain: float
    outputs: list[PlainOutput]
    effects: list[PlainEffect]

    def of(self, name: str) -> list[PlainEffect]:
        """All effects of one name."""
        return [effect for effect in self.effects if effect.name == name]


def plain(model: Any) -> Plain:
    """Read the numbers of an `idloop.physics.Model`."""
    values = model.values
    own: dict[str, dict[str, float]] = {}
    for active in model.effects:
        prefix = f"{active.name}."
        own[active.name] = {name[len(prefix) :]: value for name, value in values.items() if name.startswith(prefix)}
    inertia: list[float] = []
    viscous: list[float] = []
    stiffness: list[float] = []
    damping: list[float] = []
    place: dict[str, int] = {}
    for index, body in enumerate(model.bodies):
        if index:
            coupling = f"{model.bodies[index - 1]}-{body}"
            stiffness.append(values[f"{coupling}.stiffness"])
            damping.append(values[f"{coupling}.damping"])
        place[body] = len(inertia)
        j, b = values[f"{body}.inertia"], values[f"{body}.viscous_friction"]
        split = own.get(f"compliance@{body}")
        if split is None or not math.isfinite(split["stiffness"]):
            inertia.append(j)
            viscous.append(b)
            continue
        far, place[f"{body}_far"] = split["split"], len(inertia) + 1
        inertia += [j * (1.0 - far), j * far]
        viscous += [b * (1.0 - far), b * far]
        stiffness.append(split["stiffness"])
        damping.append(split["damping"])
    outputs = [PlainOutput(o.site, place[o.body], o.field == "velocity", o.scale) for o in model.outputs]
    sites = [o.site for o in outputs]
    effects = []
    for active in model.effects:
        if active.effect.name == "compliance":
            continue
        if active.at == "input":
            kind, where = "input", 0
        elif active.at in place:
            kind, where = "body", place[active.at]
        elif active.at in sites:
            kind, where = "output", sites.index(active.at)
        else:
            kind, where = "coupling", place[active.at.split("-")[1]] - 1
        effects.append(PlainEffect(active.effect.name, kind, where, own[active.name]))
    return Plain(inertia, viscous, stiffness, damping, values["drive.gain"], outputs, effects)
