"""What the node `controller` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import AUTOSTART, COMMON
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import NodeParameter, Table, fixed, flag, number, seconds, text, texts


def _compensation(name: str, text: str, unit: str = "") -> NodeParameter:
    """A number of the compensator, chosen automatically where it is not set."""
    return number(f"compensation_{name}", None, text, unit=unit, minimum=0.0, exclusive=True, read_only=True)


PARAMETERS: Table = (
    *COMMON,
    AUTOSTART,
    *fixed(
        text("model", "dc_motor", "Model whose input, outputs and controller section are used."),
        text(
            "controller",
            "",
            "Controller as YAML flow text, for instance {type: pid, kp: 8.4, ...}; empty takes the model's.",
        ),
        text(
            "compensation",
            "",
            "Model of the machine, as a fit or `idloop compensate --output` has written it, whose effects are "
            "cancelled beside the controller's law; empty: none.",
        ),
        texts(
            "compensation_effects", (), "Effects of it that are cancelled: name or name@site; none: all that can be."
        ),
    ),
    _compensation("limit", "Most that compensation adds to the command; not set: half of the controller's limit."),
    _compensation(
        "velocity_width",
        "Speed of the reference below which dry friction is cancelled in part; not set: what it gives the machine in "
        "two periods.",
    ),
    _compensation(
        "command_width",
        "Command below which a dead zone is crossed in part; not set: a quarter of its width, more where sensors are "
        "noisy.",
    ),
    _compensation("crossing_time", "Time in which a gap is crossed; not set: from 20 periods on.", unit="s"),
    *fixed(
        flag("use_reference", True, "Wait for and follow `reference`."),
        flag("use_excitation", False, "Wait for and add `excitation`."),
    ),
    seconds("watchdog", 0.05, "Real time: zero command after this silence.", minimum=1e-3),
    number("phase", 0.5, "Real time: when in the period the command is computed.", minimum=0.1, maximum=0.9),
)

DESCRIPTION = NodeDescription(
    about="Computes the command from measurement, reference and excitation. Lifecycle node: inactive, after an "
    "emergency stop, on a measurement that is not finite or absent, and at its end the command is zero.",
    parameters=lambda: PARAMETERS,
    publishes=("joint_command",),
    subscribes=("joint_states", "reference", "excitation"),
    services={"~/emergency_stop": "zero command until reset", "~/reset": "clear stop, fault and memory"},
    example="-p model:=torsion",
)
