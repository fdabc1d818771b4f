"""URDF: damping, dry friction and limits of the driven joint."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from idloop.exporters.exported import Exported, comment_lines, file_name, quantity, rest_left_out, xml_text
from idloop.exporters.mechanics import digits, mechanics, rigid_joint, scale_notes
from idloop.physics.model import Model

TYPES = {"rad": "continuous", "m": "prismatic"}


def export(model: Model) -> Exported:
    """Write a ``<joint>`` to merge into a robot's description.

    URDF joints are rigid: the chain moves as one body, with the friction of all of its bodies.

    Raises InputError: the positions are not those of a joint.
    """
    found = mechanics(model, "urdf")
    rigid = rigid_joint(model, found)
    joint = ET.Element("joint", name=model.input.joint, type=TYPES[model.units.position])
    ET.SubElement(joint, "dynamics", damping=digits(rigid.viscous), friction=digits(rigid.dry))
    limits = {name: value for name in ("effort", "velocity") if (value := getattr(rigid, name)) is not None}
    if limits:
        ET.SubElement(joint, "limit", {name: digits(value) for name, value in limits.items()})
    left_out = (
        f"inertia {rigid.inertia:.6g} {model.units.inertia} referred to the joint: URDF keeps it in the links",
        f"drive gain {quantity(model.parameter('drive.gain'))}: URDF efforts are forces, not commands",
        *rigid.left_out,
        *rest_left_out(model),
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
