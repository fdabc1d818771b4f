"""A plant that MuJoCo moves: a joint of any MJCF file behind the same topics as the simulated machine."""

from __future__ import annotations

from pathlib import Path

from idloop.errors import InputError
from idloop.physics import load_model
from idloop.physics.mjcf_plant import MjcfPlant
from idloop_nodes.nodes.plant import PlantNode
from idloop_nodes.parameters import NodeParameters


def machine(values: NodeParameters) -> MjcfPlant:
    """Build the machine of the parameters `mjcf`, `joints` and `actuator`."""
    if not values["mjcf"]:
        raise InputError("parameter mjcf: name the MuJoCo model, -p mjcf:=FILE.xml")
    model = load_model(values["model"])
    ours = list(dict.fromkeys(output.joint for output in model.outputs))
    theirs = [name for name in values["joints"] if name]
    if len(theirs) not in (0, len(ours)):
        raise InputError(f"parameter joints: {len(theirs)} names for {', '.join(ours)}: name each joint or none")
    return MjcfPlant(
        Path(values["mjcf"]),
        model,
        values["sample_time"],
        joints=dict(zip(ours, theirs, strict=True)) if theirs else None,
        actuator=values["actuator"],
        seed=values["seed"],
        noise=values["noise"],
    )


def make() -> PlantNode:
    """Build the node."""
    return PlantNode("mujoco_plant", machine)
