"""The machines of the suite: presets as they stand and drives of one's own, and how each is usually run."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import Any

from drives import DRIVES
from machine_kind import MachineKind

MACHINES: dict[str, MachineKind] = {
    "axis": MachineKind(
        preset="axis",
        rates=(250.0, 500.0, 1000.0),
        command=1.0,
        tempo=0.2,
        band=(0.1, 20.0),
        reference=6.0,
        speed=12.0,
        acceleration=80.0,
        controller={"type": "pd", "output": "axis.position", "kp": 4.0, "kd": 0.3, "derivative_filter": 0.004},
    ),
    "dc_motor": MachineKind(
        preset="dc_motor",
        rates=(100.0, 200.0),
        command=4.0,
        tempo=0.45,
        band=(0.05, 5.0),
        reference=8.0,
        speed=8.0,
        acceleration=25.0,
        controller={"type": "pd", "output": "motor.position", "kp": 2.0, "kd": 0.2, "derivative_filter": 0.05},
    ),
    "torsion": MachineKind(
        preset="torsion",
        rates=(200.0, 250.0),
        command=1.0,
        tempo=0.5,
        band=(0.1, 15.0),
        reference=3.0,
        speed=8.0,
        acceleration=40.0,
        controller={
            "type": "pid",
            "output": "motor.position",
            "kp": 2.0,
            "ki": 0.3,
            "kd": 0.15,
            "derivative_filter": 0.01,
        },
        delay=0.5,
    ),
    "torsion_fast": MachineKind(
        preset="torsion",
        rates=(1000.0,),
        command=1.0,
        tempo=0.5,
        band=(0.1, 15.0),
        reference=3.0,
        speed=8.0,
        acceleration=40.0,
        controller={"type": "pid", "output": "motor.position", "kp": 8.3867, "ki": 0.3255, "kd": 0.8, "limit": 2.95},
    ),
    "lead_screw": MachineKind(
        preset="lead_screw",
        rates=(500.0, 1000.0),
        command=10.0,
        tempo=0.15,
        band=(0.2, 40.0),
        reference=30.0,
        speed=80.0,
        acceleration=600.0,
        controller={"type": "pd", "output": "screw.position", "kp": 2.0, "kd": 0.1, "derivative_filter": 0.004},
        free=("rotor.inertia", "rotor.viscous_friction"),
    ),
}
MACHINES["axis_position"] = replace(MACHINES["axis"], outputs=("position[axis]",))
MACHINES["dc_position"] = replace(MACHINES["dc_motor"], outputs=("position[motor]",))
MACHINES |= DRIVES


@cache
def base_model(kind: str, rate: float, loop: str) -> Any:
    """The machine's true linear model, with its controller in closed loop.

    Parameters
    ----------
    kind : str
        A key of `MACHINES`.
    rate : float
        Samples per second.
    loop : str
        ``open`` or ``closed``.
    """
    machine = MACHINES[kind]
    model = _model_of(machine)
    if machine.outputs:
        model = replace(model, outputs=tuple(o for o in model.outputs if o.site in machine.outputs))
    if machine.free:
        model = model.with_free(machine.free)
    controller = {**machine.controller, "sample_time": 1.0 / rate} if loop == "closed" else None
    return replace(model, controller=controller)


def _model_of(machine: MachineKind) -> Any:
    from idloop.physics import load_model
    from idloop.physics.model_file import build_model
    from idloop.physics.schema import read_model_file

    if machine.document is None:
        return load_model(machine.preset)
    return build_model(read_model_file(json.dumps(machine.document), machine.preset), machine.preset)
