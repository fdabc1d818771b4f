"""The linear part: python-control takes the file back, and its response is that of our simulator."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import control
from idloop.errors import InputError
from idloop.exporters import export
from idloop.exporters.state_space import from_document, state_space
from idloop.physics import load_model, simulate


@pytest.mark.parametrize("preset", ("axis", "dc_motor", "emps", "torsion", "lead_screw"))
def test_the_file_becomes_the_same_system(preset):
    model = load_model(preset)
    file = json.loads(export(model, "control").text)
    system = state_space(model)
    read = from_document(file)
    by_hand = control.ss(file["A"], file["B"], file["C"], file["D"])
    for key in "ABCD":
        np.testing.assert_array_equal(getattr(read, key), getattr(system, key))
        np.testing.assert_array_equal(getattr(by_hand, key), getattr(system, key))
    assert read.state_labels == file["states"]
    assert read.input_labels == [model.input.name.replace(".", "_")]
    assert read.output_labels == [name.replace(".", "_") for name in model.output_names]
    assert len(file["state_units"]) == read.nstates
    assert file["output_units"] == [output.unit for output in model.outputs]


def test_it_answers_a_step_as_the_simulator():
    effects = ["compliance@axis(stiffness=20, damping=0.02, split=0.3)", "cable_spring@axis(stiffness=2)"]
    model = load_model("axis").with_effects(effects)
    time = np.linspace(0.0, 1.0, 101)
    response = control.step_response(state_space(model), time)
    ours = simulate(model, [0.0], [1.0], time).output
    np.testing.assert_allclose(response.outputs[:, 0].T, ours, atol=2e-5 * np.max(np.abs(ours)))


def test_what_is_not_linear_is_named():
    model = load_model("axis").with_effects(
        [
            "coulomb_friction@axis(level=0.1)",
            "input_delay@input(delay=0.01)",
            "cable_spring@axis(stiffness=1, rest=0.2)",
        ]
    )
    file = json.loads(export(model, "control").text)
    lost = "\n".join(file["left_out"])
    assert all(word in lost for word in ("coulomb_friction@axis (level 0.1 N·m)", "input_delay@input", "rest"))


def test_a_name_with_dots_is_no_obstacle():
    model = replace(load_model("axis"), name="axis 2.1")
    assert state_space(model).nstates == 2


@pytest.mark.parametrize(
    ("change", "words"),
    (({"schema": "other/1"}, "schema"), ({"A": None}, "A"), ({"B": [[1.0]]}, "inconsistent")),
)
def test_a_spoilt_file_is_one_line(change, words):
    file = {**json.loads(export(load_model("axis"), "control").text), **change}
    file = {key: value for key, value in file.items() if value is not None}
    with pytest.raises(InputError, match=words):
        from_document(file)
