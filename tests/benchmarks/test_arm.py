"""The machine of the arm benchmark and its description are one robot, up to the values that are to be found."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from tests.benchmarks.conftest import BENCHMARKS

pytest.importorskip("mujoco")
pytest.importorskip("pinocchio")
sys.path.append(str(BENCHMARKS))


def test_inverse_dynamics_of_mujoco_and_of_the_urdf_agree():
    import mujoco
    from arm_machine import JOINTS, URDF, Machine, machine_model, true_parameters

    from idloop.robots.rigid_body import RigidBody

    random = np.random.default_rng(0)
    machine = Machine(mass=random.uniform(0.8, 1.2, 6), payload=None)
    model = machine_model(machine)
    data = mujoco.MjData(model)
    links, own = true_parameters(machine)
    robot = RigidBody(URDF, JOINTS)
    q, v, a = random.uniform(-1.0, 1.0, size=(3, 20, 6))
    expected = robot.torque(links.ravel(), q, v, a) + own[:, 0] * a
    for k in range(20):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], v[k], a[k]
        mujoco.mj_inverse(model, data)
        # Friction is a passive and a constraint force of MuJoCo.
        assert data.qfrc_inverse + data.qfrc_passive + data.qfrc_constraint == pytest.approx(expected[k], abs=1e-6)


def test_a_planned_trajectory_is_followed_and_logged():
    from arm_machine import Hidden, Machine, fourier, run

    reference = fourier(1, 3.0)
    plain = run(Machine(), reference, rate=100.0, seed=1)
    rough = run(
        Machine((Hidden(2, "cogging", {"amplitude": 2.0, "harmonic": 9.0, "phase": 0.0}),)),
        reference,
        rate=100.0,
        seed=1,
    )
    assert plain.effort.shape == (300, 6)
    assert np.max(np.abs(plain.position - reference[::10, 0])) < 0.05
    difference = np.std(plain.effort - rough.effort, axis=0)
    assert difference[2] > 0.5
    assert difference[0] < 0.2
