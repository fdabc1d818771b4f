"""What the node `guardian` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import PEERS, START_TIMEOUT
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import Table, fixed, seconds, text

PARAMETERS: Table = (
    PEERS,
    START_TIMEOUT,
    *fixed(
        text("bridge", "bridge", "Name of the bridge's node that is watched."),
        seconds(
            "silence",
            0.03,
            "Time without a beat of the bridge after which the motor is stopped; one comes every 5 ms.",
            minimum=0.01,
            maximum=1.0,
        ),
    ),
)

DESCRIPTION = NodeDescription(
    about="Watches the process of the bridge through a Unix socket. When the bridge ends or hangs, the guardian sends"
    " the robot the message that stops the motor, which it has received from the bridge before. When the "
    "guardian ends or hangs, the bridge stops the motor. It runs on the machine of the bridge.",
    parameters=lambda: PARAMETERS,
    example="-r __ns:=/axis",
)
