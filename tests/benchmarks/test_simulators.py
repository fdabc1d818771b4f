"""The simulators that share no code with idloop agree with it, and with each other."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from check import PAIRS, TRIALS, Trial, agrees, differences, outputs

needs_mujoco = pytest.mark.skipif(
    importlib.util.find_spec("mujoco") is None, reason="mujoco is not installed (optional extra 'benchmark')"
)


@needs_mujoco
@pytest.mark.parametrize("trial", TRIALS, ids=lambda t: f"{t.preset} {' '.join(t.effects) or 'linear'}")
def test_all_three_agree_on_every_effect(trial):
    assert agrees(differences(trial, samples=800))


@needs_mujoco
@pytest.mark.parametrize("preset", ["axis", "dc_motor", "lead_screw"])
def test_linear_machines_agree_to_a_thousandth_of_the_noise(preset):
    trial = next(t for t in TRIALS if t.preset == preset and not t.effects)
    found = differences(trial, samples=800)
    assert max(found[pair][0] for pair in PAIRS) < 1e-3


def test_an_effect_changes_the_motion_by_more_than_the_simulators_differ():
    plain, rough = TRIALS[0], Trial("axis", 500.0, 1.0, ("coulomb_friction@axis(level=0.1)",))
    noise = np.array([0.0005, 0.01])
    effect = np.sqrt(np.mean(((outputs(plain, "equations", 800) - outputs(rough, "equations", 800)) / noise) ** 2))
    apart = np.sqrt(np.mean(((outputs(rough, "idloop", 800) - outputs(rough, "equations", 800)) / noise) ** 2))
    assert effect > 100.0 * apart
