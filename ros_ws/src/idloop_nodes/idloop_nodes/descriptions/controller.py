"""What the node `controller` does, its streams, services and parameters."""

from __future__ import annotations

from idloop_nodes.descriptions.common import AUTOSTART, COMMON
from idloop_nodes.descriptions.node_description import NodeDescription
from idloop_nodes.parameters import NodeParameter as P
from idloop_nodes.parameters import Table


def _compensation(name: str, text: str, unit: str = "") -> P:
    """A number of the compensator, chosen automatically where it is not set."""
    return P(f"compensation_{name}", "float", None, text, unit=unit, minimum=0.0, exclusive=True, read_only=True)


PARAMETERS: Table = (
    *COMMON,
    AUTOSTART,
    P("model", "str", "dc_motor", "Model whose input, outputs and controller section are used.", read_only=True),
    P(
        "controller",
        "str",
        "",
        "Controller as YAML flow text, for instance {type: pid, kp: 8.4, ...}; empty takes the model's.",
        read_only=True,
    ),
    P(
        "compensation",
        "str",
        "",
        "Model of the machine, as a fit or `idloop compensate --output` has written it, whose effects are cancelled "
        "beside the controller's law; empty: none.",
        read_only=True,
    ),
    P(
        "compensation_effects",
        "strs",
        (),
        "Effects of it that are cancelled: name or name@site; none: all that can be.",
        read_only=True,
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
    P("use_reference", "bool", True, "Wait for and follow `reference`.", read_only=True),
    P("use_excitation", "bool", False, "Wait for and add `excitation`.", read_only=True),
    P("watchdog", "float", 0.05, "Real time: zero command after this silence.", unit="s", minimum=1e-3),
    P("phase", "float", 0.5, "Real time: when in the period the command is computed.", minimum=0.1, maximum=0.9),
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
