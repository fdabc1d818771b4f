"""A number of the row is no signal and no time; the period stands elsewhere, or the user says it."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.api.log import recognise
from idloop.errors import InputError
from idloop.records.recognition.column_name import is_counter, parse_column_name

COUNT = 600
TIME = np.arange(COUNT) / 200.0
FORCE, ANGLE = np.sign(np.sin(5.0 * TIME)), 1.0 - np.cos(3.0 * TIME)


def _write(path, head, *columns, delimiter=","):
    rows = (delimiter.join(f"{cell:.7g}" for cell in row) for row in zip(*columns, strict=True))
    path.write_text(head + "\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["sample", "Data No", "Sample No.", "index", "tension.sample", "échantillon"])
def test_names_of_counters(name):
    assert is_counter(parse_column_name(name))


@pytest.mark.parametrize("name", ["data", "count", "encoder count", "n", "tension.value", "sample_rate", "no"])
def test_names_of_no_counters(name):
    assert not is_counter(parse_column_name(name))


@pytest.mark.parametrize(
    ("counter", "stems"), [("sample", ("tension", "angle")), ("k", ("run_tension", "run_n_angle"))]
)
def test_a_counter_in_joined_files_is_no_signal(tmp_path, counter, stems):
    rows = np.arange(COUNT)
    files = [
        _write(tmp_path / f"{stems[0]}.csv", f"{counter},t,tension (V)", rows, TIME, FORCE),
        _write(tmp_path / f"{stems[1]}.csv", f"{counter},t,angle (rad)", rows, TIME, ANGLE),
    ]
    found = recognise(files).recognition
    assert [guess.column for guess in found.guesses] == [f"{stems[0]}.tension (V)", f"{stems[1]}.angle (rad)"]


def test_a_duty_cycle_in_steps_of_one_is_no_counter(tmp_path):
    path = _write(tmp_path / "log.csv", "t,pwm,omega", np.arange(200), np.arange(200), 0.5 * np.arange(200))
    assert recognise(path, {"time": "t=s"}).recognition.of("command").column == "pwm"


@pytest.mark.parametrize(
    ("head", "period"),
    [
        ("Sampling Time,2000,us\nObject,Torque Reference,Speed\nUnit,%,min-1\nData No,,", 0.002),
        ("Sampling time,5.000,[ms]\nsample,u [V],angle [rad]", 0.005),
        ("Time (samples) TM=976.5625us,u [V],angle [rad]", 976.5625e-6),
    ],
)
def test_the_period_of_counted_samples_is_found_elsewhere(tmp_path, head, period):
    found = recognise(_write(tmp_path / "log.csv", head, np.arange(COUNT), FORCE, ANGLE)).recognition
    assert found.base.time.period == pytest.approx(period)
    assert found.of("command").column in ("Torque Reference", "u [V]")


@pytest.mark.parametrize("name", ["Data No", "Time (samples)"])
def test_counted_samples_alone_are_no_time(tmp_path, name):
    path = _write(tmp_path / "log.csv", f"{name},u [V],angle [rad]", np.arange(COUNT), FORCE, ANGLE)
    with pytest.raises(InputError, match=r"counts.*--rate HZ"):
        recognise(path)
    assert recognise(path, period=0.005).recognition.of("position").column == "angle [rad]"


def test_stamps_beside_every_signal_are_no_joint(tmp_path):
    """Simulink writes each signal as a matrix of stamps and values."""
    head = "vm[0],vm[1],theta[0],theta[1]"
    path = _write(tmp_path / "log.csv", head, TIME, FORCE, TIME, ANGLE)
    found = recognise(path)
    assert found.recognition.of("position").column == "theta[1]"
    assert not any("joints" in doubt for doubt in found.doubts)


@pytest.mark.parametrize("taken", ["X", "Y"])
def test_of_joints_with_names_the_one_that_moves_most_is_taken(tmp_path, taken):
    far, near = (2.5 * ANGLE, ANGLE) if taken == "X" else (ANGLE, 2.5 * ANGLE)
    path = _write(tmp_path / "log.csv", "t_s,X.u_A,X.pos_mm,Y.u_A,Y.pos_mm", TIME, FORCE, far, -FORCE, near)
    found = recognise(path)
    assert [one.column for one in found.recognition.guesses] == [f"{taken}.u_A", f"{taken}.pos_mm"]
    assert any(f"2 joints (X, Y); joint {taken}" in doubt for doubt in found.doubts)


def test_joints_of_topics_are_called_by_their_own_names(tmp_path):
    topics = [f"/joint_states/joint{joint}/{field}" for joint in (0, 1) for field in ("effort", "position")]
    path = _write(tmp_path / "log.csv", ",".join(["t", *topics]), TIME, FORCE, 2.0 * ANGLE, FORCE, ANGLE)
    found = recognise(path)
    assert any("2 joints (joint0, joint1); joint joint0" in doubt for doubt in found.doubts)


def test_a_counter_without_a_name_that_begins_anew_with_each_run_is_no_motion(tmp_path):
    """As boards print it: row, held command, microseconds, angle."""
    rows = np.arange(150)
    files = [
        _write(tmp_path / f"pwm-{level}.csv", f"0,{level},52,0", rows + 1, 0 * rows + level, 5000 * (rows + 1), speed)
        for level in (100, 150, 200)
        for speed in [1e-3 * level * (1.0 - np.exp(-rows / 40.0)) ** 2]
    ]
    found = recognise(files).recognition
    assert {one.role: one.column for one in found.guesses if one.role != "time"} == {"command": "1", "position": "3"}


def test_the_command_of_an_array_is_of_the_joint_with_its_number(tmp_path):
    """As PlotJuggler writes topics: efforts that were not measured are zero, and another joint swings further."""
    head = "__time,/efforts/data.0,/states/joint0/effort,/states/joint0/position,/states/joint1/effort"
    columns = (1.7e9 + TIME, FORCE, 0.0 * TIME, ANGLE, 0.0 * TIME, 3.0 * ANGLE)
    rows = "\n".join(",".join(f"{cell:.6f}" for cell in row) for row in zip(*columns, strict=True))
    (tmp_path / "log.csv").write_text(f"{head},/states/joint1/position\n{rows}\n", encoding="utf-8")
    found = recognise(tmp_path / "log.csv").recognition
    assert [one.column for one in found.guesses] == ["/efforts/data.0", "/states/joint0/position"]


def test_elements_of_arrays_behind_dots_are_those_of_joints(tmp_path):
    head = "t,/commands/torque.0,/commands/torque.1,/states/angle.0,/states/angle.1"
    path = _write(tmp_path / "log.csv", head, TIME, FORCE, 0.5 * FORCE, ANGLE, 3.0 * ANGLE)
    found = recognise(path).recognition
    assert [one.column for one in found.guesses] == ["/commands/torque.1", "/states/angle.1"]
