"""Drives as they are built, in numbers of their data sheets: the machines of the realistic cases.

Inertia and friction are what the drive's force moves, referred to the encoder's side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from machine_kind import MachineKind

# Deviation of a reading in encoder counts, and that of the noise before the rounding.
READING, BEFORE_ROUNDING = 0.35, 0.2


@dataclass(frozen=True)
class Build:
    """One drive.

    Attributes
    ----------
    unit : str
        Of the position: ``rad`` or ``m``.
    command_unit : str
    gain : float
        Force per unit of command.
    bodies : tuple of (name, inertia, viscous friction, encoder count)
        A body whose count is 0 has no encoder.
    stiffness, damping : float
        Of the coupling, where there are two bodies.
    bandwidth : float
        Of the velocity loop [rad/s].
    rates, command, tempo, band, reference, speed, acceleration
        As in `machine_kind.MachineKind`.
    """

    unit: str
    command_unit: str
    gain: float
    bodies: tuple[tuple[str, float, float, float], ...]
    bandwidth: float
    rates: tuple[float, ...]
    command: float
    tempo: float
    band: tuple[float, float]
    reference: float
    speed: float
    acceleration: float
    stiffness: float = 0.0
    damping: float = 0.0


TURN = 6.283185307

BUILDS: dict[str, Build] = {
    # a bare servomotor with a disc
    "servo": Build("rad", "A", 0.06, (("motor", 2.0e-4, 8.0e-4, TURN / 8192),), 80.0, (500.0, 1000.0),
                   command=1.0, tempo=0.25, band=(0.1, 30.0), reference=20.0, speed=40.0, acceleration=250.0),
    # direct drive of a camera, commanded in torque
    "gimbal": Build("rad", "N·m", 1.0, (("axis", 4.0e-3, 0.02, TURN / 16384),), 40.0, (200.0, 500.0),
                    command=0.2, tempo=0.2, band=(0.1, 15.0), reference=3.0, speed=6.0, acceleration=40.0),
    # direct drive of a turntable with a fine ring encoder
    "turntable": Build("rad", "A", 0.5, (("table", 0.08, 0.2, TURN / 100000),), 30.0, (200.0, 500.0),
                       command=3.0, tempo=0.4, band=(0.05, 10.0), reference=6.0, speed=5.0, acceleration=15.0),
    # a robot's joint behind a harmonic drive, seen at the joint
    "joint": Build("rad", "A", 8.0, (("joint", 1.2, 6.0, TURN / 65536),), 25.0, (100.0, 250.0, 500.0),
                   command=5.0, tempo=0.2, band=(0.05, 8.0), reference=1.2, speed=2.0, acceleration=12.0),
    # a small gear motor on a voltage amplifier with a coarse encoder
    "gear_motor": Build("rad", "V", 0.02, (("motor", 2.0e-3, 0.01, TURN / 2000),), 15.0, (100.0, 200.0),
                        command=10.0, tempo=0.2, band=(0.05, 6.0), reference=12.0, speed=10.0, acceleration=50.0),
    # a ball screw, seen at the screw
    "screw": Build("rad", "A", 0.12, (("screw", 5.0e-4, 2.5e-3, TURN / 10000),), 80.0, (500.0, 1000.0),
                   command=2.0, tempo=0.2, band=(0.1, 30.0), reference=40.0, speed=60.0, acceleration=400.0),
    # a linear motor's carriage
    "carriage": Build("m", "A", 25.0, (("carriage", 12.0, 60.0, 5.0e-6),), 60.0, (250.0, 500.0, 1000.0),
                      command=3.0, tempo=0.2, band=(0.1, 20.0), reference=0.4, speed=0.8, acceleration=5.0),
    # motor and disc on a toothed belt, an encoder at either end
    "belt": Build("rad", "A", 0.1, (("motor", 3.0e-4, 1.5e-3, TURN / 8192), ("disc", 6.0e-4, 1.0e-3, TURN / 8192)),
                  30.0, (500.0, 1000.0), command=2.0, tempo=0.3, band=(0.1, 40.0), reference=15.0, speed=30.0,
                  acceleration=150.0, stiffness=5.0, damping=2.0e-3),
    # motor and load behind a gear, referred to the motor
    "gear": Build("rad", "A", 0.05, (("motor", 1.0e-4, 4.0e-4, TURN / 4096), ("load", 2.5e-4, 4.0e-4, TURN / 16384)),
                  25.0, (250.0, 500.0, 1000.0), command=1.5, tempo=0.4, band=(0.1, 30.0), reference=20.0, speed=40.0,
                  acceleration=150.0, stiffness=0.9, damping=5.0e-4),
    # a winder: large inertias on a soft shaft
    "winder": Build("rad", "N·m", 1.0, (("motor", 0.02, 0.06, TURN / 20000), ("drum", 0.06, 0.06, TURN / 5000)),
                    8.0, (200.0, 500.0), command=3.0, tempo=0.6, band=(0.05, 12.0), reference=20.0, speed=12.0,
                    acceleration=25.0, stiffness=21.0, damping=0.03),
    # motor and bridge of a gantry, in metres
    "gantry": Build("m", "A", 40.0, (("motor", 5.0, 30.0, 2.0e-6), ("bridge", 10.0, 40.0, 1.0e-6)),
                    30.0, (250.0, 500.0, 1000.0), command=3.0, tempo=0.2, band=(0.1, 30.0), reference=0.5, speed=1.0,
                    acceleration=5.0, stiffness=5.3e4, damping=30.0),
}  # fmt: skip


def _document(name: str, build: Build) -> dict[str, Any]:
    """The drive as a model file writes it."""
    joints = [body[0] for body in build.bodies]
    outputs = []
    for joint, _, _, count in build.bodies:
        own = {"topic": "joint_states", "joint": joint}
        outputs.append({**own, "field": "position", "unit": build.unit, "noise": READING * count})
        if joint == joints[0]:
            slope = 1.4 * READING * count * build.rates[0]
            outputs.append({**own, "field": "velocity", "unit": f"{build.unit}/s", "noise": slope})
    couplings = []
    if len(joints) > 1:
        values = {"stiffness": {"value": build.stiffness, "min": 0.0}, "damping": {"value": build.damping, "min": 0.0}}
        couplings.append({"from": joints[0], "to": joints[1], **values})
    return {
        "schema": "idloop/model/1",
        "name": name,
        "description": "a drive of the diagnosis benchmark",
        "input": {"topic": "joint_command", "joint": joints[0], "field": "effort", "unit": build.command_unit},
        "outputs": outputs,
        "bodies": [
            {"name": joint, "inertia": {"value": inertia, "min": 0.0}, "viscous_friction": {"value": drag, "min": 0.0}}
            for joint, inertia, drag, _ in build.bodies
        ],
        "couplings": couplings,
        "drive": {"gain": build.gain},
        "effects": [],
        "controller": None,
    }


def _cascade(build: Build) -> Mapping[str, Any]:
    """Position loop around a velocity loop, tuned to the drive's inertia as its commissioning would."""
    inertia = sum(body[1] for body in build.bodies)
    kv = float(f"{build.bandwidth * inertia / build.gain:.3g}")
    return {
        "type": "cascade",
        "output": f"{build.bodies[0][0]}.position",
        "kp": 0.25 * build.bandwidth,
        "kv": kv,
        "ki": float(f"{0.2 * build.bandwidth * kv:.3g}"),
        "velocity_feedforward": 1.0,
        "velocity_filter": float(f"{0.1 / build.bandwidth:.3g}"),
        "limit": 3.0 * build.command,
    }


def _kind(name: str, build: Build) -> MachineKind:
    return MachineKind(
        preset=name,
        rates=build.rates,
        command=build.command,
        tempo=build.tempo,
        band=build.band,
        reference=build.reference,
        speed=build.speed,
        acceleration=build.acceleration,
        controller=_cascade(build),
        document=_document(name, build),
    )


DRIVES: dict[str, MachineKind] = {name: _kind(name, build) for name, build in BUILDS.items()}
# What only the position is read of, and what has no encoder behind the coupling.
for _name, _outputs in (
    ("servo", ("position[motor]",)),
    ("joint", ("position[joint]",)),
    ("carriage", ("position[carriage]",)),
    ("gear", ("position[motor]", "velocity[motor]")),
):
    DRIVES[f"{_name}_bare"] = replace(DRIVES[_name], outputs=_outputs)
