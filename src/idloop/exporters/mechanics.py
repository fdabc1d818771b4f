"""The part of a model that rigid-body formats represent: a chain of bodies, or all of it as one rigid joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.errors import InputError
from idloop.exporters.exported import acts, effects_left_out, quantity
from idloop.physics.effect import INPUT, parameter_as
from idloop.physics.engine import Engine
from idloop.physics.layout import Layout
from idloop.physics.model import ActiveEffect, Model, values_of

DRY = "coulomb_friction"
# Effects that a rigid body with springs has, and a joint has not.
_NOT_OF_A_JOINT = ("cable_spring", "load_torque", "compliance")


@dataclass
class Body:
    """A body of the chain, in SI units of its joint."""

    name: str
    # Inertia, viscous coefficient and level of dry friction against the ground
    inertia: float
    viscous: float
    dry: float = 0.0
    # Spring to the ground and where it is relaxed
    stiffness: float = 0.0
    rest: float = 0.0
    load: float = 0.0  # constant force


@dataclass
class Mechanics:
    """Rigid-body part of a model."""

    bodies: list[Body]  # along the chain, after compliance has split some
    body_of: dict[str, int]  # place in the chain of each body of the model
    # Place among the couplings of each coupling of the model, those inside split bodies included
    coupling_of: dict[str, int]
    # Of the couplings
    stiffness: list[float]
    damping: list[float]
    gain: float  # force on the first body per unit of command
    whole: set[str]  # effects that are represented completely
    partly: dict[str, str]  # loss by name of effects that are represented in part


def body_names(model: Model, layout: Layout) -> list[str]:
    """Names of the bodies after compliance has split some; the second half of a body is its far one."""
    ends = (*layout.body_of[1:], layout.bodies)
    return [
        name if index == first else model.far_half(name)
        for name, first, end in zip(model.bodies, layout.body_of, ends, strict=True)
        for index in range(first, end)
    ]


def mechanics(model: Model, form: str) -> Mechanics:
    """Rigid-body part of a model.

    `form`: name of the format, for the error line. Raises InputError: the positions are not those of a joint (an
    electrical analogue).
    """
    if model.units.position not in ("rad", "m"):
        where = f"its positions are in {model.units.position}, but {form} has joints in rad or m only"
        raise InputError(f"model {model.name}: {where}: choose --format control or json")
    layout = Engine(model).layout()
    axis = layout.axis
    names = body_names(model, layout)
    body_of = dict(zip(model.bodies, layout.body_of, strict=True))
    found = Mechanics(
        bodies=[Body(name, float(j), float(b)) for name, j, b in zip(names, axis.inertia, axis.viscous, strict=True)],
        body_of=body_of,
        coupling_of=dict(layout.joint_of),
        stiffness=np.asarray(axis.stiffness, dtype=float).tolist(),
        damping=np.asarray(axis.damping, dtype=float).tolist(),
        gain=model.values["drive.gain"],
        whole={active.name for active in model.effects if active.effect.splits},
        partly={},
    )
    for active in model.effects:
        if active.at not in body_of or not acts(model, active):
            continue
        level = parameter_as(active.effect, lambda effect: effect.dry_level, *model.effect_folders)
        _add(found, found.bodies[body_of[active.at]], active, values_of(active, model.values), level)
    return found


def _add(found: Mechanics, body: Body, active: ActiveEffect, values: dict[str, float], level: str) -> None:
    """Add an effect at a body, with or without a level of dry friction."""
    effect, name = active.effect, active.name
    if level:
        body.dry += values[level]
        if effect.name == DRY:
            found.whole.add(name)
        else:
            found.partly[name] = f"only its {level} is exported, as Coulomb friction"
    elif effect.name == "load_torque":
        body.load += values["torque"]
        found.whole.add(name)
    elif effect.linear and effect.force is not None:
        # A linear force is a spring, a damper and a constant, which its equation gives.
        numbers = list(values.values())
        at_rest = effect.force(0.0, 0.0, body.inertia, 0.0, [], numbers)
        spring = at_rest - effect.force(1.0, 0.0, body.inertia, 0.0, [], numbers)
        body.viscous += at_rest - effect.force(0.0, 1.0, body.inertia, 0.0, [], numbers)
        if spring:
            together = body.stiffness + spring
            body.rest = (body.stiffness * body.rest + at_rest) / together
            body.stiffness = together
        found.whole.add(name)


@dataclass(frozen=True)
class RigidJoint:
    """Numbers of the joint, in SI units, with the friction and the inertia of all bodies of the chain."""

    inertia: float
    viscous: float
    dry: float
    effort: float | None  # largest force of the drive; None without a limit
    velocity: float | None  # no-load speed; None without a limit
    left_out: tuple[str, ...]  # couplings and effects that a rigid joint cannot hold


def rigid_joint(model: Model, found: Mechanics) -> RigidJoint:
    """Return the chain moving as one body. `found`: rigid-body part of the model."""
    carried = {name for name in found.whole if name.split("@")[0] not in _NOT_OF_A_JOINT}
    efforts, speeds = [], []
    if model.loop is not None:
        efforts.append(abs(found.gain) * values_of(model.loop, model.values)["limit"])
    for active in model.effects:
        if active.effect.site != INPUT or not acts(model, active):
            continue
        values = values_of(active, model.values)
        if active.effect.name == "saturation":
            efforts.append(abs(found.gain) * values["limit"])
            carried.add(active.name)
        elif active.effect.name == "speed_limit_voltage":
            efforts.append(abs(found.gain) * values["supply"] / values["resistance"])
            found.partly[active.name] = "stall effort and no-load speed are exported, the slope between them is not"
            if values["back_emf"] > 0.0:
                speeds.append(values["supply"] / values["back_emf"])
    finite = [one for one in efforts if one < float("inf")]
    return RigidJoint(
        inertia=sum(body.inertia for body in found.bodies),
        viscous=sum(body.viscous for body in found.bodies),
        dry=sum(body.dry for body in found.bodies),
        effort=min(finite, default=None),
        velocity=min(speeds, default=None),
        left_out=(*_couplings_left_out(model), *effects_left_out(model, carried, found.partly)),
    )


def _couplings_left_out(model: Model) -> list[str]:
    lines = []
    for coupling in model.couplings:
        stiffness, damping = (quantity(model.parameter(f"{coupling}.{key}")) for key in ("stiffness", "damping"))
        lines.append(f"coupling {coupling} (stiffness {stiffness}, damping {damping}): exported as rigid")
    return lines


def scale_notes(model: Model) -> list[str]:
    """Note for forces that are only known relative to an inertia that was assumed."""
    if not model.parameter("drive.gain").free or any(model.parameter(f"{body}.inertia").free for body in model.bodies):
        return []
    return ["Forces are proportional to the inertia that the model assumes: check its value."]


def digits(value: float) -> str:
    """Text of a number with 12 digits."""
    return f"{value:.12g}"
