"""The URDF fragment: SI values of the joint, read back as a robot's description is."""

from __future__ import annotations

import importlib
from xml.etree import ElementTree as ET

import pytest

from idloop.errors import InputError
from idloop.exporters import export
from idloop.physics import load_model
from idloop.physics.model_file import from_text

ROBOT = '<robot name="r"><link name="a"/><link name="b"/>{}</robot>'


def read(model):
    return ET.fromstring(export(model, "urdf").text)


def test_damping_friction_and_effort_are_those_of_the_joint():
    model = load_model("dc_motor").with_effects(["coulomb_friction@motor(level=0.4)", "saturation@input(limit=5)"])
    joint = read(model)
    assert joint.get("name") == "motor"
    assert joint.get("type") == "continuous"
    assert float(joint.find("dynamics").get("damping")) == 2.306
    assert float(joint.find("dynamics").get("friction")) == 0.4
    # five volts of command times the drive's gain
    assert float(joint.find("limit").get("effort")) == pytest.approx(5 * 8.255, rel=1e-12)


def test_a_linear_axis_is_prismatic_and_has_no_limit_that_was_not_found():
    joint = read(load_model("emps"))
    assert joint.get("type") == "prismatic"
    assert float(joint.find("dynamics").get("damping")) == 100.0
    assert joint.find("limit") is None


def test_a_chain_moves_as_one_body():
    model = load_model("torsion").with_effects(["viscous_friction@load1(coefficient=0.01)"])
    assert float(read(model).find("dynamics").get("damping")) == pytest.approx(2e-3 + 3 * 5e-4 + 0.01, rel=1e-12)


def test_supply_and_back_emf_are_effort_and_no_load_speed():
    model = load_model("dc_motor").with_effects(
        ["speed_limit_voltage@input(supply=12, back_emf=0.5, resistance=2)", "saturation@input(limit=7)"]
    )
    limit = read(model).find("limit")
    assert float(limit.get("effort")) == pytest.approx(8.255 * 6)
    assert float(limit.get("velocity")) == 24.0


def test_what_is_lost_stands_in_the_file():
    model = load_model("torsion").with_effects(["backlash@motor-load1(gap=0.1)", "cogging@motor(amplitude=0.01)"])
    written = export(model, "urdf")
    lost = "\n".join(written.left_out)
    assert all(word in lost for word in ("backlash@motor-load1 (gap 0.1 rad)", "cogging@motor", "motor-load1", "pid"))
    assert all(line.replace("--", "- -") in written.text for line in written.left_out)


def test_forces_relative_to_an_assumed_inertia_are_marked():
    assert "inertia that the model assumes" in export(load_model("dc_motor"), "urdf").text
    assert "inertia that the model assumes" not in export(load_model("axis"), "urdf").text


def test_two_hyphens_in_a_name_do_not_break_the_comments():
    text = load_model("axis").to_yaml().replace("name: axis\ndesc", "name: a---b\ndesc")
    model = from_text(text, None)
    assert model.name == "a---b"
    assert read(model).find("dynamics") is not None


def test_an_electrical_analogue_is_no_joint():
    text = load_model("axis").to_yaml().replace("rad/s", "V/s").replace("unit: rad", "unit: V")
    for form in ("urdf", "mujoco"):
        with pytest.raises(InputError, match="positions are in V"):
            export(from_text(text, None), form)


@pytest.mark.parametrize("parser", ("yourdfpy", "urdf_parser_py.urdf"))
def test_a_parser_of_urdf_reads_it(parser, tmp_path):
    module = pytest.importorskip(parser, reason=f"no {parser}: nothing here needs it")
    model = load_model("axis").with_effects(["coulomb_friction@axis(level=0.08)"])
    joint = read(model)
    ET.SubElement(joint, "parent", link="a")
    ET.SubElement(joint, "child", link="b")
    path = tmp_path / "robot.urdf"
    path.write_text(ROBOT.format(ET.tostring(joint, encoding="unicode")), encoding="utf-8")
    reader = importlib.import_module(parser)
    assert reader is module
    robot = module.URDF.load(str(path)) if parser == "yourdfpy" else module.URDF.from_xml_file(str(path))
    dynamics = (robot.joint_map["axis"]).dynamics
    assert (float(dynamics.damping), float(dynamics.friction)) == (0.05, 0.08)


def test_the_limit_of_a_loop_in_the_drive_is_an_effort():
    text = (
        load_model("axis")
        .to_yaml()
        .replace("drive: {gain: 1.0}", "drive: {gain: 2.0, kind: velocity_loop, proportional: 3.0, limit: 6.0}")
    )
    text = text.replace("field: effort, unit: N·m", "field: velocity, unit: rad/s").partition("controller:")[0]
    assert float(read(from_text(text, None)).find("limit").get("effort")) == 12.0
