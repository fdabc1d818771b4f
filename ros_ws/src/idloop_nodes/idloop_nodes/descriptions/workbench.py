"""What the node `workbench` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import MODEL, PEERS, SAMPLE_TIME, START_TIMEOUT
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import Table, fixed, seconds, text, whole

PARAMETERS: Table = (
    PEERS,
    START_TIMEOUT,
    SAMPLE_TIME,
    *fixed(
        text(MODEL.name, MODEL.default, MODEL.description),
        text(
            "address", "127.0.0.1", "Address to serve the page at; outside this machine its URL holds a random token."
        ),
        whole("port", 8080, "Port of the page; 0 takes any that is free.", minimum=0, maximum=65535),
        seconds("history", 120.0, "Newest samples that are kept for the page.", minimum=1.0),
    ),
    seconds(
        "assess_window", 20.0, "Length of the newest data on which it is worked out where the model fails.", minimum=0.5
    ),
    *fixed(
        text("estimator_node", "estimator", "Node that diagnoses, adds and takes back."),
        text("controller_node", "controller", "Node that is stopped."),
        text("bridge_node", "", "Bridge to a robot's motor, which is stopped first; empty for none."),
        text("excitation_node", "excitation", "Node that runs experiments; stopped as well."),
    ),
)

DESCRIPTION = NodeDescription(
    about="Serves a browser page on this machine: measurement and model, where the model fails, missing effects, the "
    "ladder, the health of the graph, and a button that stops the motor. Its orders are calls of the services "
    "of the other nodes; the graph starts and runs without it. [What the page shows](how-to/workbench.md).",
    parameters=lambda: PARAMETERS,
    subscribes=(
        "reference",
        "joint_command",
        "joint_states",
        "estimator/prediction",
        "estimator/residual",
        "estimator/fit",
        "estimator/parameters",
        "estimator/missing_effects",
        "estimator/evidence",
        "estimator/ladder",
        "/diagnostics",
    ),
    example="-p model:=torsion -p port:=8080",
    uses_applied_command=True,
)
