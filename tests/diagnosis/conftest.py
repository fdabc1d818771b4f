"""Machines that hide an effect, recorded under random steps."""

import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from idloop.physics import Model, load_model
from idloop.physics.model_file import build_model
from idloop.physics.schema import read_model_file
from idloop.physics.simulation import simulate
from idloop.records import Record

# Machines of a benchmark that no model of ours describes are the tests' machines too.
MACHINES = str(Path(__file__).resolve().parents[2] / "benchmarks" / "diagnosis")
if MACHINES not in sys.path:
    sys.path.append(MACHINES)

RATE = 200.0


def record_of(
    machine: Model,
    seed: int,
    seconds: float = 12.0,
    disturbance: float = 0.0,
    name: str = "run",
    command: NDArray[np.float64] | None = None,
) -> Record:
    """Open-loop record of a machine under random steps of many sizes, or a command of one's own."""
    rng = np.random.default_rng(seed)
    if command is None:
        time = np.arange(0.0, seconds, 1.0 / RATE)
        command = rng.normal(size=int(4 * seconds) + 1)[(4 * time).astype(int)]
    time = np.arange(len(command)) / RATE
    torque = np.zeros_like(time)
    for k in range(1, len(time)):
        torque[k] = 0.9 * torque[k - 1] + rng.normal()
    torque *= disturbance * np.std(command) / max(float(np.std(torque)), 1e-12)
    noise = np.column_stack([rng.normal(size=len(time)) * float(o.noise or 0.0) for o in machine.outputs])
    output = simulate(machine, time, command + torque, time, noise=noise).output
    names = tuple(o.name for o in machine.outputs)
    units = tuple(o.unit for o in machine.outputs)
    return Record(name, time, command, time, output, "axis.effort", machine.input.unit, names, units)


@pytest.fixture(scope="module")
def start() -> Model:
    """The plain axis, a third off."""
    model = load_model("axis")
    return model.with_values({p.name: 0.7 * p.value for p in model.parameters if p.free})


SCALE_UNKNOWN = """\
schema: idloop/model/1
name: axis
input: {topic: command, joint: axis, field: effort, unit: A}
outputs:
  - {topic: states, joint: axis, field: position, unit: rad, noise: NOISE}
bodies:
  - {name: axis, inertia: 1.0, viscous_friction: {value: 5.0}}
drive: {gain: {value: 50.0}}
"""


def axis_by_current(noise: float) -> Model:
    """An axis that is commanded in amperes: the inertia is held, the gain is free. Noise of the position [rad]."""
    return build_model(read_model_file(SCALE_UNKNOWN.replace("NOISE", f"{noise:.6f}"), "axis.yaml"), "axis.yaml")
