"""Ranges for domain randomisation: intervals within bounds, and what simulators take of them."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from idloop.exporters import export
from idloop.physics import load_model

NORMAL = 1.959964  # two-sided 95 %


def fitted(effects=("coulomb_friction@axis(level=0.08)",), **stderr):
    errors = {"axis.inertia": 0.0005, "axis.viscous_friction": 0.004, "coulomb_friction@axis.level": 0.01} | stderr
    model = load_model("axis").with_effects(list(effects))
    return model.with_values(model.values, {name: errors.get(name) for name in model.values})


def document(model):
    return yaml.safe_load(export(model, "ranges").text)


def test_a_range_is_the_interval_with_its_unit_and_its_scale():
    found = document(fitted())
    assert (found["schema"], found["joint"], found["level"]) == ("idloop/ranges/1", "axis", 0.95)
    inertia = found["parameters"]["axis.inertia"]
    assert inertia["unit"] == "kg·m²"
    assert [inertia["low"], inertia["high"]] == pytest.approx(
        [0.01 - NORMAL * 0.0005, 0.01 + NORMAL * 0.0005], rel=1e-4
    )
    assert inertia["scale"] == pytest.approx([1 - NORMAL * 0.05, 1 + NORMAL * 0.05], rel=1e-4)
    assert found["without_range"] == ["drive.gain"], "it was known"


def test_a_range_ends_at_the_bounds_of_its_parameter():
    viscous = document(fitted(**{"axis.viscous_friction": 0.1}))["parameters"]["axis.viscous_friction"]
    assert viscous["low"] == 0.0
    assert viscous["high"] == pytest.approx(0.05 + NORMAL * 0.1, rel=1e-4)


def test_a_range_about_zero_is_no_scale():
    found = document(fitted(("load_torque@axis(torque=0.001)",), **{"load_torque@axis.torque": 0.01}))
    assert "scale" not in found["parameters"]["load_torque@axis.torque"]


def test_mujoco_takes_the_fields_as_they_are():
    mujoco = pytest.importorskip("mujoco", reason="no mujoco: install the extra 'benchmark'")
    found = document(fitted())["mujoco"]
    assert set(found) == {"dof_armature", "dof_damping", "dof_frictionloss"}
    machine = mujoco.MjModel.from_xml_string(export(fitted(), "mujoco").text)
    for field in ("dof_damping", "dof_frictionloss"):
        low, high = found[field]["range"]
        assert found[field]["operation"] == "abs"
        assert low < float(np.ravel(getattr(machine, field))[0]) < high
    half = NORMAL * 0.0005
    assert found["dof_armature"] == {"operation": "add", "range": pytest.approx([-half, half], rel=1e-4)}


def test_isaac_lab_scales_friction_by_one_range_that_holds_both():
    armature, friction = document(fitted())["isaac_lab"]
    assert {armature["event"], friction["event"]} == {"randomize_joint_parameters"}
    assert armature["operation"] == "add"
    assert armature["armature_distribution_params"] == pytest.approx([-NORMAL * 0.0005, NORMAL * 0.0005], rel=1e-4)
    # Dry friction is known to 12.5 %, viscous friction to 8 %.
    assert friction["operation"] == "scale"
    assert friction["friction_distribution_params"] == pytest.approx([1 - NORMAL * 0.125, 1 + NORMAL * 0.125], rel=1e-4)


def test_a_chain_has_the_ranges_of_its_parameters_and_no_joint():
    model = load_model("torsion")
    model = model.with_values(model.values, {name: 0.1 * abs(value) for name, value in model.values.items()})
    found = document(model)
    assert "motor-load1.stiffness" in found["parameters"]
    assert "mujoco" not in found


def test_a_model_that_was_not_fitted_says_so():
    written = export(load_model("axis"), "ranges")
    assert "No parameter has a standard error" in written.text
    found = yaml.safe_load(written.text)
    assert found["parameters"] == found["mujoco"] == {}
    assert found["isaac_lab"] == []


def test_an_effect_without_a_range_is_said():
    model = fitted(["cogging@axis(amplitude=0.1)"])
    assert any(line.startswith("cogging@axis") for line in export(model, "ranges").left_out)
