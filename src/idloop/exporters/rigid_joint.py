"""A chain as one rigid joint: what URDF and USD have of it, and what they lose."""

from __future__ import annotations

from dataclasses import dataclass

from idloop.exporters.exported import acts, effects_left_out, quantity
from idloop.exporters.mechanics import Mechanics
from idloop.physics.effect import INPUT
from idloop.physics.model import Model, values_of

# Effects that a rigid body with springs has, and a joint has not.
_NOT_OF_A_JOINT = ("cable_spring", "load_torque", "compliance")


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
