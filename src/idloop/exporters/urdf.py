"""URDF: damping, dry friction and limits of the driven joint."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from idloop.exporters.exported import (
    Exported,
    acts,
    comment_lines,
    controller_left_out,
    effects_left_out,
    file_name,
    quantity,
    statistics_left_out,
    xml_text,
)
from idloop.exporters.mechanics import Mechanics, digits, mechanics, scale_notes
from idloop.physics.model import Model, values_of

TYPES = {"rad": "continuous", "m": "prismatic"}


def export(model: Model) -> Exported:
    """Write a ``<joint>`` to merge into a robot's description.

    URDF joints are rigid: the chain moves as one body, with the friction of all of its bodies.

    Raises
    ------
    InputError
        The positions are not those of a joint.
    """
    found = mechanics(model, "urdf")
    joint = ET.Element("joint", name=model.input.joint, type=TYPES[model.units.position])
    ET.SubElement(
        joint,
        "dynamics",
        damping=digits(sum(body.viscous for body in found.bodies)),
        friction=digits(sum(body.dry for body in found.bodies)),
    )
    carried = {name for name in found.whole if name.split("@")[0] not in ("cable_spring", "load_torque", "compliance")}
    limits = _limits(model, found, carried)
    if limits:
        ET.SubElement(joint, "limit", {name: digits(value) for name, value in limits.items()})
    left_out = (
        *_structure_left_out(model, found),
        *effects_left_out(model, carried, found.partly),
        *controller_left_out(model),
        *statistics_left_out(model),
    )
    units = model.units
    notes = [
        f"Units: damping {units.fill('{force}·s/{position}')}, friction and effort {units.force}.",
        "Merge the inner elements into the joint of your robot; its parent, child, origin and axis stay as they are.",
    ]
    notes += scale_notes(model)
    if "effort" in limits and "velocity" not in limits:
        notes.append("URDF requires a velocity limit beside the effort limit: keep the one of your robot.")
    if units.position == "m":
        notes.append("A prismatic joint also needs lower and upper limits: keep those of your robot.")
    text = xml_text(joint, comment_lines(model, "URDF dynamics", notes, left_out))
    return Exported("urdf", file_name(model.name, ".urdf.xml"), text, left_out)


def _limits(model: Model, found: Mechanics, carried: set[str]) -> dict[str, float]:
    """Effort limit from a saturation, and the no-load speed."""
    efforts, speeds = [], []
    for active in model.effects:
        if not acts(model, active):
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
    limits = {"effort": min(efforts)} if efforts else {}
    return {**limits, "velocity": min(speeds)} if speeds else limits


def _structure_left_out(model: Model, found: Mechanics) -> list[str]:
    units = model.units
    inertia = sum(body.inertia for body in found.bodies)
    lines = [
        f"inertia {inertia:.6g} {units.inertia} referred to the joint: URDF keeps it in the links",
        f"drive gain {quantity(model.parameter('drive.gain'))}: URDF efforts are forces, not commands",
    ]
    for coupling in model.couplings:
        stiffness, damping = (quantity(model.parameter(f"{coupling}.{key}")) for key in ("stiffness", "damping"))
        lines.append(f"coupling {coupling} (stiffness {stiffness}, damping {damping}): exported as rigid")
    return lines
