"""Parameters of the workbench node."""

from __future__ import annotations

from idloop_nodes.parameters import NodeParameter as P
from idloop_nodes.parameters import Table


def workbench_table(peers: P, start_timeout: P, sample_time: P, model: P) -> Table:
    """Return the table; the common rows are given, because the table of all tables has them."""
    return (
        peers,
        start_timeout,
        sample_time,
        P(model.name, "str", model.default, model.description, read_only=True),
        P(
            "address",
            "str",
            "127.0.0.1",
            "Address to serve the page at; outside this machine its URL holds a random token.",
            read_only=True,
        ),
        P("port", "int", 8080, "Port of the page; 0 takes any that is free.", minimum=0, maximum=65535, read_only=True),
        P(
            "history",
            "float",
            120.0,
            "Newest samples that are kept for the page.",
            unit="s",
            minimum=1.0,
            read_only=True,
        ),
        P(
            "assess_window",
            "float",
            20.0,
            "Length of the newest data on which it is worked out where the model fails.",
            unit="s",
            minimum=0.5,
        ),
        P("estimator_node", "str", "estimator", "Node that diagnoses, adds and takes back.", read_only=True),
        P("controller_node", "str", "controller", "Node that is told to stop.", read_only=True),
        P(
            "bridge_node",
            "str",
            "",
            "Bridge to a robot's motor, which is told to stop first; empty for none.",
            read_only=True,
        ),
        P("excitation_node", "str", "excitation", "Node that runs experiments; stopped as well.", read_only=True),
    )
