"""USD: a joint of UsdPhysics with friction and armature of the PhysX schema, and the drive of a servo, as text."""

from __future__ import annotations

import math
import re

from idloop.exporters.exported import Exported, acts, comment_lines, file_name, quantity, rest_left_out
from idloop.exporters.mechanics import Mechanics, RigidJoint, digits, mechanics, rigid_joint, scale_notes
from idloop.physics.model import Model, values_of

# Type of the joint and instance of its schemas.
JOINTS = {"rad": ("PhysicsRevoluteJoint", "angular"), "m": ("PhysicsPrismaticJoint", "linear")}
STATIC = "stribeck_friction"  # has a level of its own at rest

_FILE = """\
#usda 1.0
(
    defaultPrim = "{name}"
    kilogramsPerUnit = 1
    metersPerUnit = 1
)

{head}
def {kind} "{name}" (
    prepend apiSchemas = [{schemas}]
)
{{
{lines}
}}
"""


def export(model: Model) -> Exported:
    """Write a joint to be referenced by that of a robot.

    Joints of an articulation are rigid: the chain moves as one body, with the friction of all of its bodies. USD has
    degrees: what is per angle or angular velocity is written per degree.

    Raises InputError: the positions are not those of a joint.
    """
    found = mechanics(model, "usd")
    static, partly = _static_friction(model, found)
    found.partly.update(partly)
    rigid = rigid_joint(model, found)
    kind, instance = JOINTS[model.units.position]
    per = math.pi / 180.0 if instance == "angular" else 1.0
    drive, lost = _drive(model, found, rigid, per)
    schemas = [f"PhysxJointAxisAPI:{instance}"]
    lines = _attributes(f"physxJointAxis:{instance}", _joint(rigid, rigid.dry + static, per))
    if drive:
        schemas.insert(0, f"PhysicsDriveAPI:{instance}")
        lines += [f'    uniform token drive:{instance}:physics:type = "force"']
        lines += _attributes(f"drive:{instance}:physics", drive)
    units = model.units
    if model.loop is None:
        lost = (f"drive gain {quantity(model.parameter('drive.gain'))}: efforts are forces, not commands", *lost)
    left_out = (*lost, *rigid.left_out, *rest_left_out(model))
    notes = [
        f"Units: kg, m, s, {units.force}; angles in degrees.",
        "PhysX applies armature and friction to joints of an articulation only.",
        "Armature is the whole inertia of the axis: where the links have inertias of their own, subtract theirs.",
        "Reference it from the joint of your robot, whose own axis, bodies and limits stay.",
        *scale_notes(model),
    ]
    name = _identifier(model.input.joint)
    named = ", ".join(f'"{one}"' for one in schemas)
    head = "\n".join(f"# {line}" for line in comment_lines(model, "USD joint", notes, left_out))
    text = _FILE.format(name=name, head=head, kind=kind, schemas=named, lines="\n".join(lines))
    return Exported("usd", file_name(model.name, ".usda"), text, left_out)


def _joint(rigid: RigidJoint, static: float, per: float) -> dict[str, float]:
    numbers = {
        "armature": rigid.inertia,
        "dynamicFrictionEffort": rigid.dry,
        "staticFrictionEffort": static,
        "viscousFrictionCoefficient": rigid.viscous * per,
    }
    return numbers if rigid.velocity is None else numbers | {"maxJointVelocity": rigid.velocity / per}


def _static_friction(model: Model, found: Mechanics) -> tuple[float, dict[str, str]]:
    """Return by how much dry friction is larger at rest, and what is lost of the effects that make it so."""
    more, partly = 0.0, {}
    for active in model.effects:
        if active.effect.name == STATIC and active.at in found.body_of and acts(model, active):
            values = values_of(active, model.values)
            more += values["static"] - values["coulomb"]
            partly[active.name] = "its levels at rest and in motion are exported, the velocity between them is not"
    return more, partly


def _drive(model: Model, found: Mechanics, rigid: RigidJoint, per: float) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the drive of a servo, and what is lost of it; a drive of a force has a limit at most."""
    most = {} if rigid.effort is None else {"maxForce": rigid.effort}
    if model.loop is None:
        return most, ()
    gains = model.loop_gains(model.values)
    stiffness, damping = -found.gain * gains.position, -found.gain * gains.velocity
    lost = []
    if damping < 0.0:
        lost.append(f"negative damping {damping:.6g} of the drive, which its delay makes: exported as 0")
    ahead = found.gain * gains.set_point - (stiffness or damping)
    if abs(ahead) > 1e-9 * max(abs(stiffness), abs(damping)):
        lost.append(
            f"feed-forward {ahead:.6g} of the set-point: a drive follows its target by stiffness and damping only"
        )
    return {"stiffness": stiffness * per, "damping": max(damping, 0.0) * per} | most, tuple(lost)


def _attributes(space: str, numbers: dict[str, float]) -> list[str]:
    return [f"    float {space}:{name} = {digits(value)}" for name, value in numbers.items()]


def _identifier(name: str) -> str:
    """Name of a prim: letters, digits and underscores, no digit first."""
    found = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"_{found}" if found[:1].isdigit() or not found else found
