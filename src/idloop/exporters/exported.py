"""A model in another tool's format: the text, and the parts of the model that it cannot represent."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from idloop.physics.model import ActiveEffect, Model
from idloop.physics.parameter import Parameter


@dataclass(frozen=True)
class Exported:
    """A file for another tool.

    Attributes
    ----------
    format : str
        Name of the format.
    file_name : str
        What to call the file.
    text : str
        Its content.
    left_out : tuple of str
        Parts of the model that the format cannot represent, one line each; also comments in the file.
    """

    format: str
    file_name: str
    text: str
    left_out: tuple[str, ...]


def file_name(model_name: str, suffix: str) -> str:
    """File name for a model, without special characters."""
    return re.sub(r"[^\w-]+", "_", model_name).strip("_")[:100] + suffix


def parameters_of(model: Model, active: ActiveEffect) -> dict[str, Parameter]:
    """Parameters of an effect of the model, by their names in the effect."""
    start = f"{active.name}."
    return {p.name.removeprefix(start): p for p in model.parameters if p.name.startswith(start)}


def acts(model: Model, active: ActiveEffect) -> bool:
    """Whether the first parameter of an effect differs from its neutral value."""
    specs = active.effect.parameters
    return not specs or model.values[f"{active.name}.{specs[0].name}"] != specs[0].neutral


def effects_left_out(
    model: Model, carried: Collection[str] = (), partly: Mapping[str, str] | None = None
) -> tuple[str, ...]:
    """Lines for the effects that a format cannot represent.

    `carried`: names of the effects that it represents, such as ``coulomb_friction@motor``; `partly`: loss by name of
    effects that it represents in part.
    """
    lines = []
    for active in model.effects:
        if active.name in carried or not acts(model, active):
            continue
        numbers = ", ".join(f"{name} {quantity(p)}" for name, p in parameters_of(model, active).items())
        lost = (partly or {}).get(active.name, active.effect.text)
        lines.append(f"{active.name} ({numbers}): {lost}")
    return tuple(lines)


def quantity(parameter: Parameter) -> str:
    """Value of a parameter with its unit."""
    return f"{parameter.value:.6g} {'' if parameter.unit == '-' else parameter.unit}".strip()


def disturbance_left_out(model: Model) -> list[str]:
    """Line for the disturbance, which no format has."""
    known = model.disturbance
    return [] if known is None else [f"disturbance force: random walk of intensity {known:.6g} {model.units.force}²/s"]


def rest_left_out(model: Model) -> list[str]:
    """Lines for what the formats of a machine lack: controller, loop beyond a linear servo, statistics."""
    lines = []
    if model.controller is not None:
        lines.append(f"controller of type {model.controller.get('type')}: --format ros2_control or json")
    beyond = [f"drive.{name}" for name in ("integral", "dead_band", "profile_velocity", "profile_acceleration")]
    if lost := ", ".join(f"{p.name} {quantity(p)}" for p in model.parameters if p.name in beyond):
        lines.append(f"of the loop in the drive: {lost}")
    if known := [p.name for p in model.parameters if p.stderr is not None]:
        lines.append(f"standard errors of {', '.join(known)}: format json has them")
    return [*lines, *disturbance_left_out(model)]


def comment_lines(model: Model, what: str, notes: Collection[str], left_out: Collection[str]) -> list[str]:
    """Comments at the head of a file: content, notes, and the parts that are left out."""
    head = [f"{what} of the model {model.name}, written by idloop export.", *notes]
    lost = ["Not represented in this format:", *(f"- {line}" for line in left_out)] if left_out else []
    return [" ".join(line.split()) for line in (*head, *(lost or ["Nothing is left out."]))]


def commented(model: Model, what: str, notes: Collection[str], left_out: Collection[str]) -> str:
    """Comments at the head of a YAML file."""
    return "".join(f"# {line}\n" for line in comment_lines(model, what, notes, left_out))


def xml_text(root: ET.Element, comments: Sequence[str]) -> str:
    """Return an indented XML document whose first lines inside the root are comments.

    `comments`: one comment each; two hyphens in a row, which XML forbids there, are set apart.
    """
    for place, line in enumerate(comments):
        root.insert(place, ET.Comment(f" {re.sub('-(?=-)', '- ', line)} "))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"
