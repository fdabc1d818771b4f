"""A MuJoCo machine behind the interface of our own: exact where it can be computed, identified, refused in one line."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="no mujoco: pip install mujoco")

from idloop.diagnosis import refine
from idloop.errors import InputError
from idloop.physics import load_model
from idloop.physics.mjcf_plant import MjcfPlant
from idloop.physics.model_file import from_text
from idloop.records import record_from_model
from idloop.signals import build_signal

INERTIA, FRICTION = 0.01, 0.05
PLAIN = f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{{step}}" integrator="implicitfast"/>
  <worldbody>
    <body name="wheel">
      <joint name="{{joint}}" type="hinge" axis="0 0 1" armature="{INERTIA / 2}" damping="{FRICTION}" {{more}}/>
      <inertial pos="0 0 0" mass="1" diaginertia="{INERTIA / 2} {INERTIA / 2} {INERTIA / 2}"/>
    </body>
  </worldbody>
  <actuator>{{actuators}}</actuator>
  <sensor>{{sensors}}</sensor>
</mujoco>
"""
MOTOR = '<motor name="drive" joint="axis" gear="1"/>'
STEP = 0.01


def plant_of(folder, *, step=1e-4, joint="axis", more="", actuators=MOTOR, sensors="", **values):
    file = folder / "machine.xml"
    file.write_text(PLAIN.format(step=step, joint=joint, more=more, actuators=actuators, sensors=sensors))
    return MjcfPlant(file, load_model("axis"), STEP, **{"noise": False} | values)


def speed(torque, seconds):
    """Velocity of inertia and viscous friction after a constant torque."""
    return torque / FRICTION * (1.0 - math.exp(-FRICTION / INERTIA * seconds))


def test_it_moves_as_the_equation_says(tmp_path):
    plant = plant_of(tmp_path)
    for index in range(100):
        plant.step(0.5, (index + 1) * STEP)
    position, velocity = plant.measure()
    assert plant.time == pytest.approx(1.0)
    assert velocity == pytest.approx(speed(0.5, 1.0), rel=1e-3)
    assert position == pytest.approx((0.5 * 1.0 - INERTIA * velocity) / FRICTION, rel=1e-3)
    plant.reset()
    assert plant.time == 0.0
    assert np.all(plant.measure() == 0.0)


def test_a_command_acts_at_its_stamp_and_a_late_one_now(tmp_path):
    plant = plant_of(tmp_path)
    plant.schedule(0.035, 1.0)
    plant.schedule(0.02, 1.0)  # no order is turned round
    plant.advance(0.05)
    assert plant.measure()[1] == pytest.approx(speed(1.0, 0.015), rel=1e-2)
    before = plant.measure()[1]
    plant.schedule(0.01, 0.0)
    plant.advance(0.06)
    assert plant.measure()[1] == pytest.approx(before * math.exp(-FRICTION / INERTIA * 0.01), rel=1e-2)


@pytest.mark.parametrize("step", [0.003, 0.02, 1e-3])
def test_its_step_divides_the_sample_time(tmp_path, step):
    plant = plant_of(tmp_path, step=step)
    assert plant.step_time <= step * (1 + 1e-9)
    assert STEP / plant.step_time == pytest.approx(round(STEP / plant.step_time))


def test_a_sensor_of_the_name_goes_before_the_joint(tmp_path):
    sensors = '<jointvel name="axis.position" joint="axis"/>'
    plant = plant_of(tmp_path, sensors=sensors)
    plant.step(1.0, STEP)
    position, velocity = plant.measure()
    assert position == velocity > 0.0


def test_joints_and_actuators_are_found_by_name(tmp_path):
    two = '<motor name="weak" joint="elbow" gear="0.1"/><motor name="strong" joint="elbow" gear="1"/>'
    speeds = {}
    for name in ("weak", "strong"):
        plant = plant_of(tmp_path, joint="elbow", actuators=two, joints={"axis": "elbow"}, actuator=name)
        plant.step(1.0, STEP)
        speeds[name] = plant.measure()[1]
    assert speeds["strong"] == pytest.approx(10.0 * speeds["weak"])


def test_equal_seeds_give_equal_noise(tmp_path):
    first, second, third = (plant_of(tmp_path, noise=True, seed=seed).measure() for seed in (1, 1, 2))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, third)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"actuators": ""}, "no actuator"),
        ({"actuator": "drve"}, "did you mean 'drive'"),
        ({"joint": "axis2", "actuators": '<motor joint="axis2"/>'}, "no joint 'axis' .did you mean 'axis2'"),
        ({"more": 'frictionlos="1"'}, "MuJoCo refuses it"),
        ({"actuators": '<motor joint="nobody"/>'}, "MuJoCo refuses it"),
    ],
)
def test_what_does_not_fit_is_one_line(tmp_path, given, said):
    with pytest.raises(InputError, match=said) as caught:
        plant_of(tmp_path, **given)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_and_a_command_that_is_none_are_refused(tmp_path):
    with pytest.raises(InputError, match="no such MJCF file"):
        MjcfPlant(tmp_path / "nothing.xml", load_model("axis"), STEP)
    with pytest.raises(InputError, match="not finite"):
        plant_of(tmp_path).step(math.nan, STEP)


def test_a_simulation_that_blows_up_is_said_and_leaves_no_file(tmp_path, monkeypatch):
    plant = plant_of(tmp_path, more='stiffness="1e9"', step=0.01)
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    plant.schedule(0.0, 1.0)
    with pytest.raises(InputError, match="unstable"):
        plant.advance(10.0)
    assert not list(here.iterdir())


MODEL = """
schema: idloop/model/1
name: flywheel
input: {topic: joint_command, joint: axis, field: effort, unit: N·m}
outputs:
  - {topic: joint_states, joint: axis, field: position, unit: rad, noise: 0.0005}
  - {topic: joint_states, joint: axis, field: velocity, unit: rad/s, noise: 0.01}
bodies:
  - {name: axis, inertia: {value: 0.02, min: 0.0}, viscous_friction: {value: 0.02, min: 0.0}}
couplings: []
drive: {gain: 1.0}
effects: []
controller: null
"""


def recorded(file, model, amplitude, seed):
    """The machine of a file under a multilevel command in open loop, at 500 Hz."""
    sample_time = 0.002
    signal = build_signal(name="multilevel", sample_time=sample_time, duration=8.0, amplitude=amplitude, seed=seed)
    plant, output = MjcfPlant(file, model, sample_time, seed=seed), []
    for index, command in enumerate(signal.value.tolist()):
        output.append(plant.measure())
        plant.step(command, (index + 1) * sample_time)
    return record_from_model(f"level{amplitude:g}", model, signal.time, signal.value, np.array(output))


def near(model, truth):
    """Every value within four of its standard errors of what the MJCF file says."""
    for name, value in truth.items():
        found = model.parameter(name)
        assert abs(found.value - value) < 4.0 * found.stderr, (name, found)


@pytest.mark.slow
def test_the_example_is_identified_and_the_files_own_values_are_found():
    model = from_text(MODEL, None)
    file = Path(__file__).parents[2] / "ros_ws" / "src" / "idloop_bringup" / "config" / "mujoco_axis.xml"
    ladder = refine(model, [recorded(file, model, amplitude, seed) for seed, amplitude in enumerate((1.0, 3.0))])
    assert set(ladder.added) == {"coulomb_friction@axis", "saturation@input"}
    near(ladder.model, {
        "axis.inertia": 0.01, "axis.viscous_friction": 0.05, "coulomb_friction@axis.level": 0.15,
        "saturation@input.limit": 2.0,
    })  # fmt: skip


GAP = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.00005" integrator="RK4"/>
  <worldbody>
    <body name="motor">
      <joint name="shaft" type="hinge" axis="0 0 1" damping="0.05"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
      <body name="load">
        <joint name="twist" type="hinge" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="coupling" stiffness="60" springlength="-0.05 0.05"><joint joint="twist" coef="1"/></fixed>
    <fixed name="load" damping="0.04"><joint joint="shaft" coef="1"/><joint joint="twist" coef="1"/></fixed>
  </tendon>
  <actuator><motor name="drive" joint="shaft" gear="1"/></actuator>
  <sensor>
    <jointpos name="motor.position" joint="shaft"/>
    <tendonpos name="load.position" tendon="load"/>
  </sensor>
</mujoco>
"""
TWO_BODIES = """
schema: idloop/model/1
name: geared
input: {topic: joint_command, joint: motor, field: effort, unit: N·m}
outputs:
  - {topic: joint_states, joint: motor, field: position, unit: rad, noise: 0.0005}
  - {topic: joint_states, joint: load, field: position, unit: rad, noise: 0.0005}
bodies:
  - {name: motor, inertia: {value: 0.01, min: 0.0}, viscous_friction: {value: 0.03, min: 0.0}}
  - {name: load, inertia: {value: 0.02, min: 0.0}, viscous_friction: {value: 0.03, min: 0.0}}
couplings:
  - {from: motor, to: load, stiffness: {value: 30.0, min: 1.0}, damping: 0.0}
drive: {gain: 1.0}
effects: []
controller: null
"""


@pytest.mark.slow
def test_the_play_of_a_coupling_is_named_and_measured(tmp_path):
    model = from_text(TWO_BODIES, None)
    (tmp_path / "gap.xml").write_text(GAP)
    ladder = refine(
        model,
        [recorded(tmp_path / "gap.xml", model, amplitude, seed) for seed, amplitude in enumerate((0.5, 1.5))],
        effects=["backlash", "hardening_stiffness", "coulomb_friction", "dead_zone", "slip"],
    )
    assert ladder.added == ("backlash@motor-load",)
    near(ladder.model, {
        "backlash@motor-load.gap": 0.1, "motor-load.stiffness": 60.0, "motor.inertia": 0.01, "load.inertia": 0.02,
        "motor.viscous_friction": 0.05, "load.viscous_friction": 0.04,
    })  # fmt: skip
