"""What the tracking graph is told, and how its bag is read; the nodes themselves do not run here."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from idloop.control.compensation import Compensation
from idloop.errors import IdloopError
from idloop.graph import load_graph
from idloop.graph.tracking import TrackingExperiment, launch_values, read_tracking
from idloop.physics import load_model
from idloop.records import Record, write_bag

LAW = {"type": "pd", "output": "axis.position", "kp": 4.0, "kd": 0.3, "limit": 10.0, "sample_time": 0.002}
SIGNAL = {"name": "smooth", "points": (1, -1.0), "amplitude": 0.5, "duration": 4.0}


def axis():
    return replace(load_model("axis").with_effects(["dead_zone@input(width=0.3)"]), controller=LAW)


def parameters(graph, executable):
    """Parameters of a node as it will find them: files first, then its own."""
    (node,) = [one for one in graph.nodes if one.executable == executable]
    found = {}
    for file in node.parameter_files:
        document = yaml.safe_load(file.read_text(encoding="utf-8"))
        for name in ("/**", node.name):
            found |= document.get(name, {}).get("ros__parameters", {})
    return found | node.parameters


def test_four_nodes_follow_a_signal_with_what_is_to_be_cancelled(tmp_path):
    compensation = Compensation(axis(), ("dead_zone",), limit=2.0, command_width=0.1)
    experiment = TrackingExperiment(axis(), load_model("axis"), SIGNAL, seed=7, noise=False)
    graph = load_graph("track", launch_values(experiment, compensation, Path("bags/new"), tmp_path))
    assert [node.executable for node in graph.nodes] == ["excitation", "controller", "recorder", "plant"]
    assert [node.executable for node in graph.nodes if node.ends_graph] == ["plant"]
    signal = parameters(graph, "excitation")
    wanted = {"signal": "smooth", "smooth.points": [1.0, -1.0], "amplitude": 0.5, "duration": 4.0, "joint": "axis"}
    assert wanted.items() <= signal.items()
    assert "smooth.dwell" not in signal, "the simulation has the signal's own default"
    law = parameters(graph, "controller")
    assert yaml.safe_load(law["controller"]) == LAW
    assert law["sample_time"] == 0.002
    assert law["compensation_effects"] == ["dead_zone"]
    assert (law["compensation_limit"], law["compensation_command_width"]) == (2.0, 0.1)
    assert "compensation_velocity_width" not in law
    assert load_model(law["compensation"]).effect_names == ("dead_zone@input",)
    plant = parameters(graph, "plant")
    assert load_model(plant["model"]).effect_names == ()
    assert (plant["seed"], plant["noise"], plant["duration"]) == (7, False, 4.0)


def test_without_compensation_the_controller_is_told_nothing_of_it(tmp_path):
    experiment = TrackingExperiment(axis(), axis(), SIGNAL)
    law = parameters(load_graph("track", launch_values(experiment, None, tmp_path / "bag", tmp_path)), "controller")
    assert law["compensation"] == ""


def test_mujoco_takes_the_place_of_the_machine(tmp_path):
    experiment = TrackingExperiment(axis(), tmp_path / "machine.xml", SIGNAL)
    graph = load_graph("track", launch_values(experiment, None, tmp_path / "bag", tmp_path))
    plant = parameters(graph, "mujoco_plant")
    assert plant["mjcf"] == str(tmp_path / "machine.xml")
    assert load_model(plant["model"]).output_names == ("axis.position", "axis.velocity")


def test_the_users_own_effects_travel_with_the_model(tmp_path):
    own = tmp_path / "own"
    (own / "effects").mkdir(parents=True)
    (own / "effects" / "lean.py").write_text(
        "from idloop.physics.effect import BODY, Effect, EffectParameter\nfrom idloop.physics.hooks import hook\n\n\n"
        "@hook\ndef force(a, b, c, elapsed, state, parameters):\n    return parameters[0]\n\n\n"
        'EFFECT = Effect("lean", BODY, "It leans.", (EffectParameter("size", "{force}"),), force=force)\n',
        encoding="utf-8",
    )
    (own / "model.yaml").write_text(load_model("axis").to_yaml(), encoding="utf-8")
    leaning = load_model(str(own / "model.yaml"), allow_effects=True).with_effects(["lean@axis(size=0.1)"])
    model = replace(leaning, controller=LAW)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    values = launch_values(TrackingExperiment(model, model, SIGNAL), Compensation(model), tmp_path / "bag", scratch)
    assert load_model(values["compensation"]).effect_names == ("lean@axis",)


def recorded(tmp_path, reference):
    time = np.arange(100) * 0.002
    return write_bag(
        tmp_path / "bag",
        Record(
            name="tracked",
            input_time=time,
            input=np.arange(100.0),
            time=time,
            output=np.ones((100, 2)),
            input_name="axis.effort",
            input_unit="N·m",
            output_names=("axis.position", "axis.velocity"),
            output_units=("rad", "rad/s"),
            reference_time=None if reference is None else np.arange(len(reference)) * 0.002,
            reference=reference,
        ),
    )


def test_a_bag_is_read_at_the_stamps_of_its_measurements(tmp_path):
    # Published ahead of the clock: more of it than was measured.
    reference = np.column_stack([np.arange(150.0), np.zeros(150)])
    run = read_tracking(recorded(tmp_path, reference), axis())
    assert np.array_equal(run.error[:, 0], np.arange(100.0) - 1.0)
    assert np.array_equal(run.command, np.arange(100.0))
    assert run.followed == ("axis.position",)


def test_a_bag_without_a_reference_is_one_line(tmp_path):
    with pytest.raises(IdloopError, match="no reference was recorded"):
        read_tracking(recorded(tmp_path, None), axis())
