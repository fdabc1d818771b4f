"""The MJCF: MuJoCo loads it, holds the same numbers, and moves as our simulator does."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.exporters import export
from idloop.physics import load_model, simulate

mujoco = pytest.importorskip("mujoco", reason="no mujoco: install the extra 'benchmark'")

CHAIN = [
    "coulomb_friction@load1(level=0.004)",
    "cable_spring@load3(stiffness=0.1, rest=0.3)",
    "cable_spring@motor(stiffness=0.2, rest=-1.0)",
]
OFFSET = ["saturation@input(limit=0.6)", "input_offset@input(offset=0.2)"]
LOAD = ["load_torque@axis(torque=-30)", "coulomb_friction@axis(level=20)"]
# What is carried whole, on one body and on a chain.
SAME = {
    "motor with dry friction": ("dc_motor", ["coulomb_friction@motor(level=2.0)"], 1.0, 0.002),
    "limited command with an offset": ("dc_motor", OFFSET, 1.0, 0.002),
    "lag of the drive": ("axis", ["actuator_lag@input(time_constant=0.05)"], 0.5, 0.002),
    "linear axis with a load": ("emps", LOAD, 6.0, 0.002),
    "flexible chain": ("torsion", [], 0.5, 0.005),
    "chain with friction and cables": ("torsion", CHAIN, 1.5, 0.01),
    "compliance": ("axis", ["compliance@axis(stiffness=20, damping=0.02, split=0.3)"], 0.5, 0.005),
    "four bodies": ("lead_screw", [], 2.0, 0.005),
}  # fmt: skip


def load(model):
    return mujoco.MjModel.from_xml_string(export(model, "mujoco").text)


@pytest.mark.parametrize("name", SAME)
def test_it_moves_as_our_simulator(name):
    preset, effects, size, tolerance = SAME[name]
    model = load_model(preset).with_effects(effects)
    machine = load(model)
    machine.opt.timestep = 5e-5 if len(model.bodies) > 1 else 2e-4
    steps = round(0.01 / machine.opt.timestep)
    data = mujoco.MjData(machine)
    time = 0.01 * np.arange(200)
    command = size * np.sign(np.sin(2 * np.pi * 0.8 * time) + 0.4)
    seen = np.empty((len(time), len(model.outputs)))
    for k, value in enumerate(command):
        mujoco.mj_forward(machine, data)
        seen[k] = data.sensordata * [output.scale for output in model.outputs]
        data.ctrl[0] = value
        for _ in range(steps):
            mujoco.mj_step(machine, data)
    ours = simulate(model, time, command, time).output
    error = np.sqrt(np.mean((seen - ours) ** 2, axis=0)) / np.sqrt(np.mean(ours**2, axis=0))
    assert np.max(np.abs(ours)) > 0.0
    assert np.max(error) < tolerance


NEW_EFFECTS = {
    "cogging": ["cogging@axis(amplitude=0.05, harmonic=7, phase=0.3)"],
    "weight of an arm": ["gravity@axis(moment=0.3, lowest=0.4)"],
    "lopsided": ["imbalance@axis(amplitude=0.1, phase=1.0)"],
    "quadratic drag": ["quadratic_drag@axis(coefficient=0.02)"],
    "late commands and a late sensor": ["input_delay@input(delay=0.02)", "sensor_delay@position[axis](delay=0.01)"],
}


@pytest.mark.skipif(int(mujoco.__version__.partition(".")[0]) < 4, reason="MuJoCo before 4 does not know them")
@pytest.mark.parametrize("name", NEW_EFFECTS)
def test_what_mujoco_has_learnt_moves_as_our_simulator(name):
    model = load_model("axis").with_effects(NEW_EFFECTS[name])
    assert export(model, "mujoco").left_out == export(load_model("axis"), "mujoco").left_out
    machine = load(model)
    data = mujoco.MjData(machine)
    time = 0.01 * np.arange(200)
    command = 0.6 * np.sign(np.sin(5.0 * time) + 0.4)
    seen = np.empty((len(time), 2))
    for k, value in enumerate(command):
        mujoco.mj_forward(machine, data)
        seen[k] = data.sensordata
        data.ctrl[0] = value
        mujoco.mj_step(machine, data, round(0.01 / machine.opt.timestep))
    ours = simulate(model, time, command, time).output
    error = np.sqrt(np.mean((seen - ours) ** 2, axis=0)) / np.sqrt(np.mean(ours**2, axis=0))
    assert np.max(error) < 0.02


def test_a_gap_without_damping_is_carried_whole():
    model = load_model("torsion").with_effects(["backlash@motor-load1(gap=0.4)"])
    damped = export(model, "mujoco")
    model = model.with_values({"motor-load1.damping": 0.0})
    assert "backlash" in "".join(damped.left_out)
    assert "backlash" not in "".join(export(model, "mujoco").left_out)
    machine = load(model)
    machine.opt.timestep = 1e-5
    data = mujoco.MjData(machine)
    time = 0.01 * np.arange(100)
    seen = []
    data.ctrl[0] = 0.5
    for _ in time:
        mujoco.mj_forward(machine, data)
        seen.append(data.sensordata.copy())
        mujoco.mj_step(machine, data, 1000)
    ours = simulate(model, [0.0], [0.5], time).output
    np.testing.assert_allclose(seen, ours, atol=5e-3 * np.max(np.abs(ours)))
    without_gap = simulate(model.without_effect("backlash@motor-load1"), [0.0], [0.5], time).output
    assert np.max(np.abs(without_gap - ours)) > 2e-2 * np.max(np.abs(ours))


def test_a_gap_inside_a_body_is_carried_between_its_halves():
    model = load_model("axis").with_effects(["compliance@axis(stiffness=20)", "backlash@axis-axis_far(gap=0.02)"])
    exported = export(model, "mujoco")
    assert not any("backlash" in line or "compliance" in line for line in exported.left_out)
    machine = load(model)
    np.testing.assert_allclose(machine.tendon_lengthspring[machine.tendon("backlash-axis-axis_far").id], [-0.01, 0.01])


def test_the_numbers_are_those_of_the_model():
    model = load_model("torsion").with_effects([*CHAIN, "saturation@input(limit=2)", "backlash@motor-load1(gap=0.02)"])
    machine = load(model)
    assert machine.body("motor").inertia == pytest.approx(3.11e-5)
    assert 'armature="3.11e-05"' in export(model, "mujoco").text
    assert machine.dof_damping[0] == pytest.approx(2e-3)
    np.testing.assert_allclose(machine.dof_damping[1:].ravel()[:3], 1e-3)
    assert machine.body("load2").inertia == pytest.approx(5.46e-4)
    assert machine.tendon_frictionloss[machine.tendon("load1").id] == pytest.approx(0.004)
    np.testing.assert_allclose(machine.tendon_lengthspring[machine.tendon("load3").id], 0.3)
    np.testing.assert_allclose(machine.tendon_lengthspring[machine.tendon("backlash-motor-load1").id], [-0.01, 0.01])
    assert machine.actuator("motor").gainprm[0] == pytest.approx(0.0742)
    np.testing.assert_allclose(machine.actuator("motor").ctrlrange, [-2.0, 2.0])


def test_a_cable_relaxed_at_minus_one_stays_there():
    machine = load(load_model("torsion").with_effects(["cable_spring@load1(stiffness=1, rest=-1)"]))
    np.testing.assert_allclose(machine.tendon_lengthspring[machine.tendon("load1").id], -1.0, rtol=1e-8)


@pytest.mark.parametrize("preset", ("axis", "dc_motor", "emps", "torsion", "lead_screw"))
def test_every_preset_loads_and_its_own_step_is_stable(preset):
    machine = load(load_model(preset))
    data = mujoco.MjData(machine)
    data.ctrl[0] = 1.0
    mujoco.mj_step(machine, data, 300)
    assert np.all(np.isfinite(data.qpos))
    assert np.max(np.abs(data.qpos)) > 0.0


def test_what_is_lost_is_said():
    model = load_model("lead_screw").with_effects(["dead_zone@input(width=0.01)", "load_torque@nut(torque=0.1)"])
    lost = "\n".join(export(model, "mujoco").left_out)
    assert all(word in lost for word in ("dead_zone@input (width 0.01 ", "load_torque@nut", "scale of stage.velocity"))
