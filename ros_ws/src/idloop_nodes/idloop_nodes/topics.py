"""The topics of a graph: type and content of each."""

from __future__ import annotations

JOINT_STATE = "sensor_msgs/msg/JointState"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
HEADER = "std_msgs/msg/Header"
CLOCK = "rosgraph_msgs/msg/Clock"

TOPICS: dict[str, tuple[str, str]] = {
    "reference": (JOINT_STATE, "what the controller follows: position and velocity"),
    "excitation": (JOINT_STATE, "added to the reference (position) or to the command (effort)"),
    "joint_command": (JOINT_STATE, "command in the model's input unit; stamp = when it takes effect"),
    "joint_states": (JOINT_STATE, "measurement; NaN where not measured"),
    "bridge/command": (JOINT_STATE, "command that a robot received, in our unit, after all limits; stamp = when"),
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
        "newest evidence for every effect, and which estimates may be trusted (latched)",
    ),
    "estimator/ladder": (DIAGNOSTICS, "effects added so far, with the error at each step (latched)"),
    "estimator/wear": (DIAGNOSTICS, "what has grown since the machine was healthy, if watched (latched)"),
    "progress": (HEADER, "how far each node has come: flow control and start barrier"),
    "/clock": (CLOCK, "simulated time (lock-step only)"),
    "/diagnostics": (DIAGNOSTICS, "health, once a second, as `node: check` with the namespace before it"),
}

RECORDED = tuple(name for name in TOPICS if name not in ("progress", "/clock", "/diagnostics"))
RESULTS = tuple(name for name in RECORDED if TOPICS[name][0] == DIAGNOSTICS)
