"""The USD joint: numbers per degree, read back as text and by USD itself."""

from __future__ import annotations

import math
import re

import pytest

from idloop.errors import InputError
from idloop.exporters import export
from idloop.physics import load_model
from idloop.physics.model_file import from_text

DEGREE = math.pi / 180.0
POSITION = "gain: 2.0, kind: position_loop, proportional: 30.0, derivative: 0.4, limit: 6.0"
VELOCITY = "kind: velocity_loop, proportional: 3.0, feed_forward: 0.5, limit: 6.0"


def servo(drive=POSITION, field="position", unit="rad", joint="arm"):
    text = f"""
schema: idloop/model/1
name: servo
input: {{joint: {joint}, field: {field}, unit: {unit}}}
outputs: [{{joint: arm, field: position, unit: rad}}]
bodies: [{{name: arm, inertia: 0.01, viscous_friction: 0.05}}]
drive: {{{drive}}}
"""
    return from_text(text, None)


def attributes(text):
    """Numbers and tokens of the joint by their names."""
    found = dict(re.findall(r"^    (?:uniform )?(?:float|token) ([\w:]+) = (.+)$", text, re.MULTILINE))
    return {name: value.strip('"') if '"' in value else float(value) for name, value in found.items()}


def test_friction_and_armature_are_those_of_the_joint_per_degree():
    model = load_model("dc_motor").with_effects(["coulomb_friction@motor(level=0.4)", "saturation@input(limit=5)"])
    written = export(model, "usd")
    assert written.file_name == "dc_motor.usda"
    assert 'def PhysicsRevoluteJoint "motor"' in written.text
    assert attributes(written.text) == pytest.approx(
        {
            "physxJointAxis:angular:armature": 1.0,
            "physxJointAxis:angular:dynamicFrictionEffort": 0.4,
            "physxJointAxis:angular:staticFrictionEffort": 0.4,
            "physxJointAxis:angular:viscousFrictionCoefficient": 2.306 * DEGREE,
            "drive:angular:physics:type": "force",
            "drive:angular:physics:maxForce": 5 * 8.255,
        }
    )


def test_a_linear_axis_has_no_degrees_and_no_drive_without_a_limit():
    text = export(load_model("emps"), "usd").text
    assert "def PhysicsPrismaticJoint" in text
    assert attributes(text)["physxJointAxis:linear:viscousFrictionCoefficient"] == 100.0
    assert "DriveAPI" not in text
    assert "angular" not in text


def test_friction_that_is_larger_at_rest_has_both_levels():
    written = export(load_model("axis").with_effects(["stribeck_friction@axis(coulomb=0.1, static=0.25)"]), "usd")
    found = attributes(written.text)
    assert found["physxJointAxis:angular:dynamicFrictionEffort"] == 0.1
    assert found["physxJointAxis:angular:staticFrictionEffort"] == 0.25
    assert any("the velocity between them is not" in line for line in written.left_out)


def test_a_position_servo_is_a_drive_with_the_force_of_its_loop():
    model = servo()
    found = attributes(export(model, "usd").text)
    # The force at an error of one degree at rest, and at one degree per second on the target.
    gains = model.loop_gains(model.values)
    assert found["drive:angular:physics:stiffness"] == pytest.approx(2.0 * 30.0 * DEGREE)
    assert found["drive:angular:physics:damping"] == pytest.approx(-2.0 * gains.velocity * DEGREE)
    assert found["drive:angular:physics:maxForce"] == pytest.approx(12.0)


def test_a_velocity_servo_is_damping_and_its_feed_forward_is_lost():
    written = export(servo(VELOCITY, "velocity", "rad/s"), "usd")
    found = attributes(written.text)
    assert found["drive:angular:physics:stiffness"] == 0.0
    assert found["drive:angular:physics:damping"] == pytest.approx(3.0 * DEGREE)
    assert any(line.startswith("feed-forward 0.5 of the set-point") for line in written.left_out)


def test_the_no_load_speed_is_in_degrees():
    model = load_model("dc_motor").with_effects(["speed_limit_voltage@input(supply=12, back_emf=0.5, resistance=2)"])
    assert attributes(export(model, "usd").text)["physxJointAxis:angular:maxJointVelocity"] == pytest.approx(
        24.0 / DEGREE
    )


def test_what_is_lost_stands_in_the_file():
    model = load_model("torsion").with_effects(["backlash@motor-load1(gap=0.1)", "cogging@motor(amplitude=0.01)"])
    written = export(model, "usd")
    lost = "\n".join(written.left_out)
    assert all(word in lost for word in ("backlash@motor-load1 (gap 0.1 rad)", "cogging@motor", "motor-load1", "pid"))
    assert all(f"# - {line}" in written.text for line in written.left_out)


def test_a_name_becomes_that_of_a_prim():
    assert 'def PhysicsRevoluteJoint "_4_axis"' in export(servo(joint="4-axis"), "usd").text


def test_an_electrical_analogue_is_no_joint():
    text = load_model("axis").to_yaml().replace("rad/s", "V/s").replace("unit: rad", "unit: V")
    with pytest.raises(InputError, match="positions are in V"):
        export(from_text(text, None), "usd")


def test_usd_reads_it_and_a_joint_that_references_it_keeps_its_own_axis(tmp_path):
    Usd = pytest.importorskip("pxr.Usd", reason="no usd-core: nothing here needs it")
    UsdPhysics = pytest.importorskip("pxr.UsdPhysics")
    path = tmp_path / "axis.usda"
    path.write_text(export(servo(), "usd").text, encoding="utf-8")
    stage = Usd.Stage.CreateInMemory()
    joint = UsdPhysics.RevoluteJoint.Define(stage, "/robot/elbow")
    joint.CreateAxisAttr("Y")
    joint.GetPrim().GetReferences().AddReference(str(path))
    drive = UsdPhysics.DriveAPI(joint.GetPrim(), "angular")
    assert drive.GetStiffnessAttr().Get() == pytest.approx(60.0 * DEGREE)
    assert drive.GetMaxForceAttr().Get() == pytest.approx(12.0)
    assert joint.GetAxisAttr().Get() == "Y"
    assert "PhysxJointAxisAPI:angular" in joint.GetPrim().GetMetadata("apiSchemas").GetAddedOrExplicitItems()
    assert joint.GetPrim().GetAttribute("physxJointAxis:angular:armature").Get() == pytest.approx(0.01)
