"""``python -m idloop_nodes.document [FILE]``: the reference of all nodes, from the tables that the nodes run on."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from idloop_nodes.parameters import NodeParameter
from idloop_nodes.tables import tables
from idloop_nodes.wiring import ASKING, NODES, TOPICS

ABOUT = {
    "excitation": "Builds the whole signal once and publishes it ahead of the clock, each sample stamped with the "
    "time at which it holds. Lifecycle node: inactive, it publishes neutral values. An experiment is put between the "
    "samples of the normal signal, with a smooth way in and back, after a check of the `limit.*` parameters; where a "
    "motion limit is set, the axis is watched on `joint_states` and a breach deactivates the node.",
    "controller": "Computes the command from measurement, reference and excitation. Lifecycle node: inactive, after "
    "an emergency stop, on a measurement that is not finite or absent, and at its end the command is zero.",
    "bridge": "The last node before the motor: passes a robot's measurement of a joint on to us and our command on to "
    "the robot, within limits that no message and no service can widen. Lifecycle node: inactive, after an emergency "
    "stop or a breach of a limit, while a stream is silent, not finite or its clock jumps, and at its end the motor is "
    "told to stay. All limits are in our units, and ours = scale × the robot's + offset. [Which fault ends how "
    "soon](how-to/bridge.md).",
    "guardian": "Watches the process of the bridge through a Unix socket. When the bridge ends, whatever ends it, or "
    "gives no sign of life, the guardian sends the robot the message that stops the motor, which the bridge has told "
    "it before. When the guardian ends or hangs, the bridge stops the motor. It runs on the machine of the bridge.",
    "plant": "Simulates the machine. In lock-step it steps when the command arrives and waits for slow listeners; "
    "in real time it measures at absolute deadlines.",
    "mujoco_plant": "Takes the place of the plant (node name `plant`) with a joint of any MJCF file, moved by MuJoCo "
    "(`pip install mujoco`): a machine that nobody here wrote, behind the same topics.",
    "recorder": "Writes every message as it came into a rosbag2 directory (mcap, 16 KiB chunks) and counts every loss.",
    "estimator": "Predicts every sample, fits a sliding window in a worker process, judges the fit on the samples "
    "after the window. Diagnoses in the same worker process when told to, after an experiment, and by itself when "
    "the free-run residual of successive fits stops being white; in lock-step simulated time waits for it. With "
    "`recursion` a black-box model of each output follows every sample beside the prediction: measurements that are "
    "NaN, and samples that never came, are predicted and teach nothing; a bag gives the same in `idloop identify`. "
    "With `monitor` it watches wear: an alarm is an error on `/diagnostics` and on `estimator/wear`, at the rate of "
    "false ones that is asked for. [How it decides](how-to/monitor.md).",
    "replay": "Plays a recording into the live graph, byte for byte.",
    "workbench": "Serves a browser page on this machine: measured and model, where the model fails, what is missing, "
    "the ladder, the health of the graph, and a button that stops the motor. Passes orders on to the services of the "
    "other nodes; only looks on, so that the graph starts and runs without it. [What the page shows](how-to/workbench.md).",
}
SERVICES = {
    "excitation": {
        "~/start": "start the signal from its beginning",
        "~/stop": "neutral values from the next sample, whatever runs",
        "~/run_experiment": "play the parameter `experiment` once, then go on with the signal",
        "~/stop_experiment": "end it now and go on with the signal",
    },
    "bridge": {
        "~/emergency_stop": "stop the motor until reset",
        "~/reset": "clear stop and breach, unless the breach still holds, and start softly",
    },
    "controller": {"~/emergency_stop": "zero command until reset", "~/reset": "clear stop, fault and memory"},
    "estimator": {
        "~/refit": "fit the newest window now",
        "~/diagnose": "find out what is missing, on the newest data and all experiments",
        "~/add_best_effect": "add what the newest diagnosis names first, and refit",
        "~/undo": "take the last step of the ladder back; `auto_add` and `auto_experiment` are then switched off",
        "~/run_suggested_experiment": "work out what separates the effects that tie, let the excitation run it, "
        "then diagnose again",
    },
}
EXAMPLE = {
    "excitation": "-p signal:=prbs -p prbs.band_hz:=10.0 -p amplitude:=0.6",
    "controller": "-p model:=torsion",
    "bridge": "-r __ns:=/axis -p robot_joints:=\"['elbow']\" -p joints:=\"['motor']\" -p limit.command:=2.0",
    "guardian": "-r __ns:=/axis",
    "plant": "-p model:=torsion -p duration:=10.0 -p effects:=\"['coulomb_friction@motor(level=0.01)']\"",
    "mujoco_plant": "-p mjcf:=robot.xml -p model:=axis -p joints:=\"['elbow']\" -p actuator:=elbow_motor",
    "recorder": "-p bag:=bags/first",
    "estimator": "-p model:=torsion -p window:=10.0",
    "replay": "-p bag:=bags/first -p rate:=1.0",
    "workbench": "-p model:=torsion -p port:=8080",
}


def document() -> str:
    """Return the reference as Markdown."""
    lines = [
        "# Nodes",
        "",
        "Written by `python -m idloop_nodes.document docs/nodes.md`; do not edit.",
        "Each node is its own process: `ros2 run idloop_nodes NODE`, or `python -m idloop_nodes NODE`.",
        "Every node publishes `/diagnostics` once a second and `progress`.",
        "",
        "## Topics",
        "",
        *_table(("topic", "type", "content"), ((f"`{name}`", kind, text) for name, (kind, text) in TOPICS.items())),
    ]
    for kind, table in tables().items():
        lines += _section(kind, table)
    return "\n".join(lines) + "\n"


def _section(kind: str, table: Iterable[NodeParameter]) -> list[str]:
    wiring = NODES[kind]
    lines = ["", f"## {kind}", "", ABOUT[kind], ""]
    publishes, subscribes = (", ".join(f"`{one}`" for one in side) for side in (wiring.publishes, wiring.subscribes))
    lines.append(f"Publishes: {publishes or 'only the common topics'}.  ")
    instead = " (behind a bridge `bridge/command` instead of `joint_command`)" if kind in ASKING else ""
    lines.append(f"Subscribes: {subscribes or 'none'}{instead}.")
    if kind in SERVICES:
        services = ((f"`{name}`", text) for name, text in SERVICES[kind].items())
        lines += ["", *_table(("service (std_srvs/Trigger)", "does"), services)]
    lines += ["", *_table(("parameter", "type", "default", "range", "unit", "meaning"), map(_row, table))]
    lines += ["", f"    ros2 run idloop_nodes {kind} --ros-args {EXAMPLE[kind]}"]
    return lines


def _row(spec: NodeParameter) -> tuple[str, ...]:
    default = "not set" if spec.default is None else repr(spec.default) if spec.default != () else "none"
    if isinstance(spec.default, tuple) and spec.default:
        default = ", ".join(map(str, spec.default))
    text = spec.description + (" Fixed at the start." if spec.read_only else "")
    return f"`{spec.name}`", spec.ros_type, default, spec.range_text.replace("|", "/"), spec.unit, text


def _table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    return [
        "| " + " | ".join(header) + " |",
        "|" + "---|" * len(header),
        *("| " + " | ".join(one.replace("|", "\\|") for one in row) + " |" for row in rows),
    ]


if __name__ == "__main__":
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(document(), encoding="utf-8")
    else:
        sys.stdout.write(document())
