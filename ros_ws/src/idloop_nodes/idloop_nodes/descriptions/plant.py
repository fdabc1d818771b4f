"""What the node `plant` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import COMMON, EFFECTS, MACHINE, MODEL
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import Table, fixed, number, seconds, text, texts

PARAMETERS: Table = (
    *COMMON,
    *fixed(
        text(MODEL.name, MODEL.default, MODEL.description),
        texts(EFFECTS.name, (), "Hidden effects: " + EFFECTS.description),
        number(
            "disturbance_std",
            0.0,
            "Standard deviation of the disturbance torque on the driven body, in the drive's unit.",
            minimum=0.0,
        ),
        seconds("disturbance_time_constant", 1.0, "Correlation time of the disturbance.", minimum=1e-3),
    ),
    *MACHINE,
)

DESCRIPTION = NodeDescription(
    about="Simulates the machine. In lock-step it steps when the command arrives and waits for slow listeners; in real "
    "time it measures at absolute deadlines.",
    parameters=lambda: PARAMETERS,
    publishes=("joint_states", "/clock"),
    subscribes=("joint_command",),
    example="-p model:=torsion -p duration:=10.0 -p effects:=\"['coulomb_friction@motor(level=0.01)']\"",
)
