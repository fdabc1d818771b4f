"""What the node `replay` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import DRAIN_TIMEOUT, LISTENERS, PEERS, START_TIMEOUT, WINDOW
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import Table, fixed, number, text, texts

PARAMETERS: Table = (
    PEERS,
    START_TIMEOUT,
    *fixed(
        text("bag", "", "Recording to play."),
        texts("topics", ("reference", "excitation", "joint_command", "joint_states"), "What to play."),
    ),
    number("rate", 0.0, "Times real time; 0 plays as fast as the listeners acknowledge.", minimum=0.0),
    LISTENERS,
    WINDOW,
    DRAIN_TIMEOUT,
)

DESCRIPTION = NodeDescription(
    about="Plays a recording into the live graph, byte for byte.",
    parameters=lambda: PARAMETERS,
    publishes=("reference", "excitation", "joint_command", "joint_states"),
    example="-p bag:=bags/first -p rate:=1.0",
)
