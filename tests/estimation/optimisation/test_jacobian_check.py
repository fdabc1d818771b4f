"""Smooth errors, and those of a machine that chatters in its backlash."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.estimation import fit
from idloop.estimation.optimisation.jacobian_check import jacobian_unreliable
from idloop.physics.model_file import from_text
from idloop.physics.simulation import simulate
from idloop.records.from_model import record_from_model

MODEL = """
schema: idloop/model/1
name: gear
input: {topic: joint_command, joint: motor, field: effort, unit: N·m}
outputs:
  - {topic: joint_states, joint: load, field: position, unit: rad}
bodies:
  - {name: motor, inertia: {value: 2.0e-4}, viscous_friction: {value: 3.0e-3}}
  - {name: load, inertia: {value: 6.0e-4}, viscous_friction: {value: 1.0e-3}}
couplings:
  - {from: motor, to: load, stiffness: {value: 40.0}, damping: {value: DAMPING}}
drive: {gain: 1.0}
effects:
  - {effect: backlash, at: motor-load, gap: {value: 0.03}}
"""
NOISE = 1e-4


@pytest.mark.parametrize(("grain", "rough"), [(0.0, False), (1e-3, False), (10.0, True)])
def test_a_jacobian_of_noise_is_unreliable(grain, rough):
    sensitivity = np.random.default_rng(0).normal(size=(500, 3))

    def residual(point):
        chance = np.random.default_rng(abs(hash(tuple(point))))
        return 1e4 * sensitivity @ point + 500.0 * (sensitivity @ point) ** 2 + grain * chance.normal(size=500)

    box = np.full(3, 10.0)
    assert jacobian_unreliable(residual, np.array([1.0, 2.0, 0.5]), -box, box, np.ones(3), 3) == rough


@pytest.mark.parametrize(("damping", "hold", "rattles"), [(0.01, 0.05, True), (0.3, 0.5, False)])
def test_the_intervals_of_a_chattering_machine_give_a_warning(damping, hold, rattles):
    model = from_text(MODEL.replace("DAMPING", str(damping)), None)
    chance = np.random.default_rng(1)
    time = np.arange(3000) * 2e-3
    held = round(hold / 2e-3)
    command = np.repeat(chance.uniform(-0.1, 0.1, len(time) // held + 1), held)[: len(time)]
    output = simulate(model, time, command, time).output
    record = record_from_model("run", model, time, command, output + NOISE * chance.normal(size=output.shape))
    found = fit(model, [record], criterion="prediction")
    assert any("contacts in the backlash" in warning for warning in found.warnings) == rattles
