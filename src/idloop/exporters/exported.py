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


def statistics_left_out(model: Model, *, intervals: bool = False) -> tuple[str, ...]:
    """Lines for standard errors and the disturbance; with `intervals` the format has the standard errors."""
    known = [] if intervals else [p.name for p in model.parameters if p.stderr is not None]
    lines = [f"standard errors of {', '.join(known)}: format json has them"] if known else []
    if model.disturbance is not None:
        lines.append(f"disturbance force: random walk of intensity {model.disturbance:.6g} {model.units.force}²/s")
    return tuple(lines)


def controller_left_out(model: Model) -> tuple[str, ...]:
    """Line for the controller, where a format has none."""
    if model.controller is None:
        return ()
    return (f"controller of type {model.controller.get('type')}: --format ros2_control or json",)


def loop_left_out(model: Model) -> tuple[str, ...]:
    """Line for what a linear servo with a limit lacks of the loop in the drive."""
    if model.loop is None:
        return ()
    beyond = ("integral", "dead_band", "profile_velocity", "profile_acceleration")
    own = [p for p in model.parameters if p.name.startswith("drive.") and p.name.removeprefix("drive.") in beyond]
    lost = ", ".join(f"{p.name} {quantity(p)}" for p in own)
    return (f"of the loop in the drive: {lost}",) if lost else ()


def comment_lines(model: Model, what: str, notes: Collection[str], left_out: Collection[str]) -> list[str]:
    """Comments at the head of a file: content, notes, and the parts that are left out."""
    head = [f"{what} of the model {model.name}, written by idloop export.", *notes]
    lost = (
        ["Not represented in this format:", *(f"- {line}" for line in left_out)]
        if left_out
        else ["Nothing is left out."]
    )
    return [" ".join(line.split()) for line in (*head, *lost)]


def xml_text(root: ET.Element, comments: Sequence[str]) -> str:
    """Return an indented XML document whose first lines inside the root are comments.

    `comments`: one comment each; two hyphens in a row, which XML forbids there, are set apart.
    """
    for place, line in enumerate(comments):
        safe = line
        while "--" in safe:
            safe = safe.replace("--", "- -")
        root.insert(place, ET.Comment(f" {safe} "))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"
