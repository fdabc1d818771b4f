"""What an inspection says of the joint of a model, before its fit."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import idloop
from idloop.api.inspection import bag_grades, inspect_bag
from idloop.cli import main
from idloop.records import make_stream, write_bag
from idloop.records.inspection.grade import EVERYTHING, NOT_USABLE, USABLE

MODEL = idloop.load_model("dc_motor")


@pytest.fixture(scope="module")
def record():
    levels = np.repeat(np.random.default_rng(1).uniform(-5.0, 5.0, 40), 20)
    return idloop.simulate(MODEL, levels, sample_time=0.01)


def _early(record):
    """The motion as it is stamped by another clock, 0.13 s before the command; on other stamps, so not row by row."""
    return replace(record, input_time=record.input_time + 0.1334)


def test_a_sound_bag_has_no_line(tmp_path, record):
    (found,) = bag_grades([write_bag(tmp_path / "sound", record)], MODEL)
    assert (found.grade, found.line(), found.faults) == (USABLE, "", ())


def test_a_fit_says_in_one_line_what_is_wrong_with_a_bag(tmp_path, record, capsys):
    bags = write_bag(tmp_path / "sound", record), write_bag(tmp_path / "early", _early(record))
    assert main.run(["fit", "dc_motor", *map(str, bags), "--quiet", "--json"]) == 0
    out, err = capsys.readouterr()
    (line,) = [one for one in err.splitlines() if str(bags[1]) in one]
    assert line.startswith(f"{bags[1]}: {NOT_USABLE} {EVERYTHING}: two clocks: ")
    assert line.endswith(f"(idloop inspect {bags[1]})")
    assert str(bags[0]) not in err
    first, second = json.loads(out)["inspections"]
    assert (first["bag"], first["grade"], first["faults"]) == (str(bags[0]), USABLE, [])
    assert second["grade"] == f"{NOT_USABLE} {EVERYTHING}"
    assert [one["kind"] for one in second["faults"]] == ["two_clocks"]


def test_a_fault_that_spoils_nothing_is_said_once(tmp_path, record, capsys):
    wrong = replace(record, output=record.output * [1.0, 3.0])
    bag = write_bag(tmp_path / "wrong", wrong)
    (found,) = bag_grades([bag], MODEL)
    assert found.line().startswith(f"{bag}: usable with care: motor.velocity is 2.988 ")
    assert main.run(["fit", "dc_motor", str(bag), "--quiet"]) == 0
    assert capsys.readouterr().err.count("times the slope of motor.position") == 1


def test_faults_of_other_joints_are_not_said(tmp_path, record):
    stamps = (10**9 + 1e9 * record.time).astype(np.int64)
    # Of the other joint each velocity is three times what its position says.
    other = {"position": record.output[:, 0], "velocity": 3.0 * record.output[:, 1]}
    own = {"position": record.output[:, 0], "velocity": record.output[:, 1]}
    streams = [
        make_stream("joint_command", stamps, {"motor": {"effort": record.input}}),
        make_stream("joint_states", stamps, {"motor": own, "arm": other}),
    ]
    bag = write_bag(tmp_path / "two", streams)
    assert [one.where for one in inspect_bag(bag).faults] == ["arm.velocity"]
    (found,) = bag_grades([bag], MODEL)
    assert found.line() == ""


def test_a_set_point_is_no_fault_for_a_model_of_the_loop_in_the_drive(tmp_path, set_point_log):
    log = set_point_log(1.0, "rad")
    for unit, kinds in (("V", ["inner_loop"]), ("rad", [])):
        begun = idloop.start(log, tmp_path / unit, {"command": f"servo_cmd={unit}"}, fitted=False)
        (found,) = bag_grades(begun.bags, begun.model)
        assert [one.kind for one in found.faults if one.kind == "inner_loop"] == kinds


def test_no_diagnosis_is_offered_after_a_fit_of_what_is_of_no_use(tmp_path, record, capsys):
    truth = MODEL.with_effects(["dead_zone@input(width=2.0)"])
    levels = np.repeat(np.random.default_rng(1).uniform(-5.0, 5.0, 40), 20)
    sound = idloop.simulate(truth, levels, sample_time=0.01)
    unsigned = replace(sound, input=np.abs(sound.input))
    offered = {}
    for name, one in {"sound": sound, "unsigned": unsigned}.items():
        bag = write_bag(tmp_path / name, one)
        assert main.run(["fit", "dc_motor", str(bag), "--quiet"]) == 0
        offered[name] = "idloop diagnose" in capsys.readouterr().out
    assert bag_grades([tmp_path / "unsigned"], MODEL)[0].useless
    assert offered == {"sound": True, "unsigned": False}


def test_a_measured_command_is_no_fault_of_a_model_that_says_so(tmp_path, record):
    time, random = np.arange(3000) * 0.01, np.random.default_rng(4)
    waves = [(0.5 + 1.3 * k, k * k) for k in range(12)]
    position, velocity, acceleration = (
        sum(f**n * np.sin(f * time + p + n * np.pi / 2) for f, p in waves) for n in range(3)
    )
    output = np.column_stack([position, velocity]) + random.normal(size=(time.size, 2)) * [1e-4, 1e-3]
    smooth = replace(
        record, time=time, input_time=time, input=(acceleration + 2.0 * velocity) / 8.0, output=output, findings=()
    )
    bag = write_bag(tmp_path / "bag", smooth)
    measured = replace(MODEL, input=replace(MODEL.input, kind="measured"))
    held, modelled = ([one.kind for one in bag_grades([bag], model)[0].faults] for model in (MODEL, measured))
    assert held == ["measured_input"]
    assert modelled == []
