"""The parameter file: rclpy reads it, and the gains make the same law."""

from __future__ import annotations

from dataclasses import replace

import pytest
import yaml

from idloop.exporters import export
from idloop.exporters.ros2_control import FORWARD, IDENTIFIED, PID, TRAJECTORY
from idloop.physics import load_model


def read(model):
    return yaml.safe_load(export(model, "ros2_control").text)


def paths(section, above=""):
    """Names of the parameters in a section, levels joined by dots."""
    for name, value in section.items():
        if "unit" in value:
            yield above + name
        else:
            yield from paths(value, f"{above}{name}.")


def law(**spec):
    return replace(load_model("dc_motor"), controller={"sample_time": 0.002, "output": "motor.position", **spec})


def gains(model):
    (found,) = read(model)[PID]["ros__parameters"]["gains"].values()
    return found


def test_a_pid_keeps_gains_limit_joint_and_rate():
    model = load_model("torsion")
    file = read(model)
    section = file[PID]["ros__parameters"]
    assert section["dof_names"] == ["motor"]
    assert section["command_interface"] == "effort"
    found = gains(model)
    assert (found["p"], found["i"], found["d"]) == (8.3867, 0.3255, 0.8)
    assert (found["u_clamp_max"], found["u_clamp_min"]) == (2.95, -2.95)
    assert found["antiwindup_strategy"] == "back_calculation"
    manager = file["controller_manager"]["ros__parameters"]
    assert manager["update_rate"] == 1000
    assert manager[PID]["type"] == "pid_controller/PidController"
    assert file[FORWARD]["ros__parameters"] == {"joints": ["motor"], "interface_name": "effort"}


def test_the_tighter_of_two_limits_is_kept():
    assert gains(load_model("torsion").with_effects(["saturation@input(limit=1.5)"]))["u_clamp_max"] == 1.5


def test_a_cascade_is_the_pid_that_it_equals():
    kp, kv, ki = 12.0, 3.0, 5.0
    found = gains(law(type="cascade", kp=kp, kv=kv, ki=ki, velocity_feedforward=1.0))
    # e = kp r + dr/dt; kv e + ki ∫e, its coefficients of ∫r, r and dr/dt
    assert found["p"] == kp * kv + ki
    assert found["i"] == kp * ki
    assert found["d"] == kv


def test_scaled_feedback_and_linearisation_are_in_the_gains():
    model = law(type="p", kp=2.0, feedback_gain=0.5, linearisation={"gain": 4.0, "offset": 0.1})
    assert gains(model)["p"] == pytest.approx(0.25)
    lost = "\n".join(export(model, "ros2_control").left_out)
    assert "feedback_gain 0.5" in lost
    assert "linearisation.offset 0.1" in lost


def test_a_velocity_loop_gets_the_viscous_friction_ahead():
    model = law(type="p", kp=2.0, output="motor.velocity")
    assert gains(model)["feedforward_gain"] == pytest.approx(2.306 / 8.255)
    assert read(model)[PID]["ros__parameters"]["reference_and_state_interfaces"] == ["velocity"]


def test_a_position_loop_gets_it_ahead_in_the_controller_of_trajectories():
    model = law(type="pid", kp=2.0, ki=0.5, kd=0.1, limit=3.0)
    file = read(model)
    section = file[TRAJECTORY]["ros__parameters"]
    assert section["joints"] == ["motor"]
    assert section["command_interfaces"] == ["effort"]
    assert section["gains"]["motor"] == {**gains(model), "ff_velocity_scale": pytest.approx(2.306 / 8.255)}
    manager = file["controller_manager"]["ros__parameters"]
    assert manager[TRAJECTORY]["type"] == "joint_trajectory_controller/JointTrajectoryController"
    assert TRAJECTORY not in read(law(type="p", kp=2.0, output="motor.velocity"))


def test_what_was_identified_is_there_with_units_and_intervals():
    model = load_model("dc_motor").with_effects(["dead_zone@input(width=0.12)"])
    model = model.with_values({"drive.gain": 8.0}, {"drive.gain": 0.1})
    found = read(replace(model, controller=None))[IDENTIFIED]["ros__parameters"]
    assert found["drive"]["gain"]["value"] == 8.0
    assert found["drive"]["gain"]["unit"] == model.parameter("drive.gain").unit
    assert found["drive"]["gain"]["interval_95"] == pytest.approx([8.0 - 0.196, 8.0 + 0.196], abs=1e-3)
    assert found["dead_zone"]["input"]["width"] == {"value": 0.12, "unit": "V"}
    assert set(paths(found)) == {parameter.name.replace("@", ".") for parameter in model.parameters}


@pytest.mark.parametrize(
    "spec", (None, {"type": "lead", "output": "axis.position", "gain": 1.0, "zero": 1.0, "pole": 9.0})
)
def test_a_law_that_is_no_pid_leaves_the_forward_controller(spec):
    controller = spec and {**spec, "sample_time": 0.01}
    written = export(replace(load_model("axis"), controller=controller), "ros2_control")
    assert PID not in yaml.safe_load(written.text)
    assert any("lead" in line for line in written.left_out) == (spec is not None)


def test_a_small_gain_is_a_number_to_yaml_1_1():
    # 1e-05 without a point is text there.
    assert gains(law(type="p", kp=1e-5))["p"] == 1e-5


def test_rclpy_reads_the_file(tmp_path):
    reader = pytest.importorskip("rclpy.parameter", reason="no rclpy: run launch_scripts/test, or source a ROS 2")
    model = law(type="pid", kp=0.25, ki=2.0, kd=0.0)
    path = tmp_path / "parameters.yaml"
    path.write_text(export(model, "ros2_control").text, encoding="utf-8")
    found = reader.parameter_dict_from_yaml_file(str(path), target_nodes=[PID])
    assert found["gains.motor.p"].value.double_value == 0.25
    assert found["gains.motor.i"].value.double_value == 2.0
    assert list(found["dof_names"].value.string_array_value) == ["motor"]
    identified = reader.parameter_dict_from_yaml_file(str(path), target_nodes=[IDENTIFIED])
    assert identified["motor.viscous_friction.value"].value.double_value == 2.306
    manager = reader.parameter_dict_from_yaml_file(str(path), target_nodes=["controller_manager"])
    assert manager["update_rate"].value.integer_value == 500
