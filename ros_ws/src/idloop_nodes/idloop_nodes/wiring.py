"""Which node publishes and subscribes which stream: for the start barrier and for the documentation."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from idloop.records.bags.topics import APPLIED_COMMAND, REQUESTED_COMMAND

JOINT_STATE = "sensor_msgs/msg/JointState"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
HEADER = "std_msgs/msg/Header"
CLOCK = "rosgraph_msgs/msg/Clock"

TOPICS: dict[str, tuple[str, str]] = {
    "reference": (JOINT_STATE, "what the controller follows: position and velocity"),
    "excitation": (JOINT_STATE, "added to the reference (position) or to the command (effort)"),
    "joint_command": (JOINT_STATE, "command in the model's input unit; stamp = when it takes effect"),
    "joint_states": (JOINT_STATE, "measurement; NaN where not measured"),
    "bridge/command": (JOINT_STATE, "what a robot was told, in our unit, after all limits; stamp = when"),
    "estimator/prediction": (JOINT_STATE, "one step ahead, stamped like its measurement"),
    "estimator/residual": (JOINT_STATE, "measurement minus prediction, stamped likewise"),
    "estimator/innovation": (
        JOINT_STATE,
        "innovation of the recursive black-box model, stamped likewise; if asked for",
    ),
    "estimator/fit": (DIAGNOSTICS, "newest fit, judged on samples it has not used (latched)"),
    "estimator/parameters": (DIAGNOSTICS, "its parameters with standard errors (latched)"),
    "estimator/coefficients": (DIAGNOSTICS, "of the recursive black-box model, with standard errors (latched)"),
    "estimator/missing_effects": (DIAGNOSTICS, "newest diagnosis: verdict, and one status for each effect (latched)"),
    "estimator/evidence": (
        DIAGNOSTICS,
        "newest look at the evidence for every effect, and which estimates may be trusted (latched)",
    ),
    "estimator/ladder": (DIAGNOSTICS, "effects added so far, with the error at each step (latched)"),
    "estimator/wear": (DIAGNOSTICS, "what has grown since the machine was healthy, if watched (latched)"),
    "progress": (HEADER, "how far each node has come: flow control and start barrier"),
    "/clock": (CLOCK, "simulated time (lock-step only)"),
    "/diagnostics": (DIAGNOSTICS, "health, once a second, as `node: check` with the namespace before it"),
}

RECORDED = tuple(name for name in TOPICS if name not in ("progress", "/clock", "/diagnostics"))
RESULTS = tuple(name for name in RECORDED if TOPICS[name][0] == DIAGNOSTICS)


@dataclass(frozen=True)
class Wiring:
    """Streams of one kind of node; `progress` and `/diagnostics` are common to all."""

    publishes: tuple[str, ...]
    subscribes: tuple[str, ...]


NODES: dict[str, Wiring] = {
    "excitation": Wiring(("reference", "excitation"), ("/clock",)),
    "controller": Wiring(("joint_command",), ("joint_states", "reference", "excitation")),
    "bridge": Wiring(("joint_states", "bridge/command"), ("joint_command",)),
    "guardian": Wiring((), ()),
    "plant": Wiring(("joint_states", "/clock"), ("joint_command",)),
    "recorder": Wiring((), RECORDED),
    "estimator": Wiring(
        ("estimator/prediction", "estimator/residual", "estimator/innovation", *RESULTS),
        ("joint_states", "joint_command", "reference"),
    ),
    "replay": Wiring(("reference", "excitation", "joint_command", "joint_states"), ()),
    "workbench": Wiring(
        (),
        (
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
    ),
}
NODES["mujoco_plant"] = NODES["plant"]  # it stands in the same place


# They ask what the machine was told.
ASKING = ("estimator", "workbench")


def told(topic: str, family: Iterable[str]) -> str:
    """Topic on which a machine's own commands are heard: behind a bridge what it lets pass, after all limits.

    Parameters
    ----------
    topic : str
        Of the command, as the model names it.
    family : iterable of str
        Kinds of the nodes of the graph.
    """
    return APPLIED_COMMAND if topic == REQUESTED_COMMAND and "bridge" in family else topic


def subscriptions(kind: str, family: Iterable[str]) -> tuple[str, ...]:
    """Topics that a kind of node subscribes to in a graph of these kinds."""
    if kind not in NODES:
        return ()
    topics = NODES[kind].subscribes
    return tuple(told(topic, family) for topic in topics) if kind in ASKING else topics


def expected_subscribers(topic: str, peers: Collection[str]) -> int:
    """Return how many of `peers` subscribe `topic`."""
    return sum(topic in subscriptions(peer, peers) for peer in peers)


def expected_publishers(topic: str, peers: Iterable[str]) -> int:
    """Return how many of `peers` publish `topic`."""
    return sum(topic in NODES[peer].publishes for peer in peers if peer in NODES)
