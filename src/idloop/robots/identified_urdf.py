"""A URDF with the identified inertias, damping and friction in place of its own."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.exporters.mechanics import digits, mechanics
from idloop.physics.model import Model
from idloop.robots.inertia import pseudo_inertia
from idloop.robots.rigid_body import PER_LINK


def identified_urdf(text: str, links: Mapping[str, Array], models: Mapping[str, Model]) -> str:
    """Write the identified values into a URDF.

    A link behind a fixed joint is one body with the link before it: its own inertia is removed.

    `text`: the URDF. `links` (10,): inertial parameters of the link that each joint moves, by the name of the joint.
    `models`: of each joint: viscous and dry friction. Raises InputError: the text is no XML.
    """
    try:
        root = ET.fromstring(text, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))  # noqa: S314 - the user's own file
    except ET.ParseError as error:
        raise InputError(f"the URDF is no valid XML: {error}") from error
    joints = {str(one.get("name")): one for one in root.findall("joint")}
    bodies = {str(one.get("name")): one for one in root.findall("link")}
    fixed = {name: _link(one, "child") for name, one in joints.items() if name not in links}
    parents = {child: _link(joints[name], "parent") for name, child in fixed.items()}
    for child in parents:
        before, carried = child, {_link(joints[name], "child") for name in links}
        while before in parents and before not in carried:
            before = parents[before]
        inertial = bodies[child].find("inertial")
        if before in carried and inertial is not None:
            bodies[child].remove(inertial)
    for name, parameters in links.items():
        _write_inertia(bodies[_link(joints[name], "child")], parameters)
        _write_friction(joints[name], models[name])
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _link(joint: ET.Element, end: str) -> str:
    found = joint.find(end)
    return "" if found is None else str(found.get("link"))


def _write_inertia(link: ET.Element, parameters: Array) -> None:
    old = link.find("inertial")
    if old is not None:
        link.remove(old)
    mass, first = float(parameters[0]), parameters[1:4] / parameters[0]
    second = pseudo_inertia(parameters[:PER_LINK])[:3, :3] - mass * np.outer(first, first)
    inertia = np.trace(second) * np.eye(3) - second
    new = ET.Element("inertial")
    ET.SubElement(new, "origin", xyz=" ".join(map(digits, first)), rpy="0 0 0")
    ET.SubElement(new, "mass", value=digits(mass))
    pairs = {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1), "yz": (1, 2), "zz": (2, 2)}
    ET.SubElement(new, "inertia", {f"i{key}": digits(float(inertia[at])) for key, at in pairs.items()})
    link.insert(0, new)


def _write_friction(joint: ET.Element, model: Model) -> None:
    body = mechanics(model, "urdf").bodies[0]
    old = joint.find("dynamics")
    found = ET.SubElement(joint, "dynamics") if old is None else old
    found.set("damping", digits(body.viscous))
    found.set("friction", digits(body.dry))
