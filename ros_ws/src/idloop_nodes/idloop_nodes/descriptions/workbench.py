"""What the node `workbench` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import MODEL, PEERS, SAMPLE_TIME, START_TIMEOUT
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import NodeParameter as P
from idloop_nodes.parameters import Table

PARAMETERS: Table = (
    PEERS,
    START_TIMEOUT,
    SAMPLE_TIME,
    P(MODEL.name, "str", MODEL.default, MODEL.description, read_only=True),
    P(
        "address",
        "str",
        "127.0.0.1",
        "Address to serve the page at; outside this machine its URL holds a random token.",
        read_only=True,
    ),
    P("port", "int", 8080, "Port of the page; 0 takes any that is free.", minimum=0, maximum=65535, read_only=True),
    P("history", "float", 120.0, "Newest samples that are kept for the page.", unit="s", minimum=1.0, read_only=True),
    P(
        "assess_window",
        "float",
        20.0,
        "Length of the newest data on which it is worked out where the model fails.",
        unit="s",
        minimum=0.5,
    ),
    P("estimator_node", "str", "estimator", "Node that diagnoses, adds and takes back.", read_only=True),
    P("controller_node", "str", "controller", "Node that is stopped.", read_only=True),
    P("bridge_node", "str", "", "Bridge to a robot's motor, which is stopped first; empty for none.", read_only=True),
    P("excitation_node", "str", "excitation", "Node that runs experiments; stopped as well.", read_only=True),
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
