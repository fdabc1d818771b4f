"""What the node `mujoco_plant` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import COMMON, MACHINE
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import Table, fixed, text, texts

PARAMETERS: Table = (
    *COMMON,
    *fixed(
        text("model", "axis", "Model whose outputs are measured, with its units and noise."),
        text("mjcf", "", "MuJoCo model (MJCF file) of the machine."),
        texts(
            "joints",
            (),
            "Joint of the MJCF file for each joint that the model measures; empty: of the same name. "
            "An MJCF sensor with the name of an output, such as motor.position, goes before its joint.",
        ),
        text("actuator", "", "Actuator of the MJCF file that takes the command; empty: the only one."),
    ),
    *MACHINE,
)

DESCRIPTION = NodeDescription(
    about="Takes the place of the plant (node name `plant`) with a joint of any MJCF file, simulated by MuJoCo (`pip "
    "install mujoco`): a machine whose simulation is independent of ours, behind the same topics.",
    parameters=lambda: PARAMETERS,
    publishes=("joint_states", "/clock"),
    subscribes=("joint_command",),
    example="-p mjcf:=robot.xml -p model:=axis -p joints:=\"['elbow']\" -p actuator:=elbow_motor",
)
