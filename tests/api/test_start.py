"""From the files of a log to a fitted model: one step, whatever the files look like."""

from __future__ import annotations

import math
import re
import shlex
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.io import savemat

import idloop
from idloop.api.first_fit import FirstFit, _is_predicted, judged
from idloop.api.log import Log, _are_signals, recognise
from idloop.api.start import begin, forwards_beside_position, more_than_one_axis, with_causes
from idloop.diagnosis.screening.command_response import command_response
from idloop.errors import InputError
from idloop.records import Finding, make_stream, write_bag
from idloop.records.tables.importing import import_bag
from idloop.records.tables.mapping import load_mapping
from idloop.records.tables.table_files import read_table


@pytest.fixture(scope="module")
def record():
    """An axis with the inertia 0.01 kg·m² and the viscous friction 0.05 N·m·s/rad."""
    signal = idloop.excitation("multilevel", sample_time=0.01, duration=15.0, amplitude=0.5, seed=3)
    return idloop.simulate(idloop.load_model("axis"), signal, seed=3)


def _columns(record):
    return {"t": record.time, "u": record.input, "q": record.output[:, 0], "w": record.output[:, 1]}


def _write(path, header, *columns, form="{:.7g}", delimiter=","):
    rows = (delimiter.join(form.format(cell) for cell in row) for row in zip(*columns, strict=True))
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def test_a_log_becomes_a_folder_with_everything_in_it(record, tmp_path):
    c = _columns(record)
    log = _write(
        tmp_path / "log.csv", "Time [ms];Torque [mNm];Angle [deg];Speed [rpm]",
        1e3 * c["t"], 1e3 * c["u"], np.degrees(c["q"]), c["w"] * 30 / np.pi, delimiter=";",
    )  # fmt: skip
    begun = idloop.start(log, tmp_path / "begun")
    assert begun.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.03)
    assert begun.fit.values["axis.viscous_friction"] == pytest.approx(0.05, rel=0.03)
    names = {path.name for path in (tmp_path / "begun").iterdir()}
    assert names == {"mapping.yaml", "model.yaml", "fitted.yaml", "bags", "log.png"}
    assert begun.log.recognition.all_doubts() == []
    # What was written repeats it.
    model = idloop.load_model(tmp_path / "begun" / "model.yaml")
    again = idloop.fit(model, idloop.read_bags(begun.bags, model))
    assert again.values == begun.fit.values
    assert load_mapping(tmp_path / "begun" / "mapping.yaml").position[0].unit == "deg"
    assert begun.commands[0].startswith("idloop diagnose")
    document = begun.to_dict()
    assert document["schema"] == "idloop/start/1"
    assert [one["role"] for one in document["signals"]] == ["command", "position", "velocity"]
    assert "Time [ms]" in begun.summary()
    assert len(begun.plot().axes) == 3


def test_a_velocity_in_no_unit_is_left_out_and_said(record, tmp_path):
    """It may be the time that is wrong: nothing is scaled until both agree."""
    c = _columns(record)
    log = _write(tmp_path / "log.csv", "t [s],u [Nm],angle [rad],speed", c["t"], c["u"], c["q"], 1.989 * c["w"])
    begun = idloop.start(log, tmp_path / "begun")
    assert begun.inspections[0].grade == "usable with care"
    assert any("a sample time that is 1.989 times too long" in line for line in begun.said())
    assert "wrong by this factor" in begun.summary()


def test_files_with_the_same_columns_are_records_of_one_axis(record, tmp_path):
    c = _columns(record)
    half = c["t"].size // 2
    logs = [
        _write(tmp_path / "run_0.1.csv", "t,tau,q", *(c[k][:half] for k in "tuq")),
        _write(tmp_path / "run_0.2.csv", "q,t,tau", *(c[k][half:] for k in "qtu")),
    ]
    begun = idloop.start(logs, tmp_path / "begun")
    assert [bag.name for bag in begun.bags] == ["run_0.1", "run_0.2"]
    assert begun.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)


def test_files_with_different_columns_are_joined_by_time(record, tmp_path):
    c = _columns(record)
    logs = [
        _write(tmp_path / "drive.csv", "t,torque_Nm", c["t"], c["u"]),
        _write(tmp_path / "encoder.csv", "time_us,angle_rad", 1e6 * c["t"][::2] + 300, c["q"][::2], form="{:.9g}"),
    ]
    begun = idloop.start(logs, tmp_path / "begun")
    assert len(begun.bags) == 1
    assert begun.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)


def test_files_without_a_header_whose_names_are_those_of_signals_are_one_record(record, tmp_path):
    c = _columns(record)
    logs = [tmp_path / "run1_pos.t", tmp_path / "run1_tau.t"]
    for log, values in zip(logs, (c["q"], c["u"]), strict=True):
        np.savetxt(log, np.column_stack([c["t"], values]), fmt="%.7g")
    found = recognise(logs)
    assert found.joined
    assert [(one.role, one.column) for one in found.recognition.guesses] == [
        ("command", "run1_tau.1"), ("position", "run1_pos.1")
    ]  # fmt: skip
    other = recognise(logs, {"time": "=ms"}).recognition
    assert [other.base.time.unit, *(one.unit for one in other.clocks.values())] == ["ms", "ms"]


def test_files_of_one_column_whose_names_are_those_of_signals_are_one_record(record, tmp_path):
    c = _columns(record)
    logs = [tmp_path / "lift_joystick.txt", tmp_path / "boom_angle_rad.txt"]
    for log, values in zip(logs, (c["u"], c["q"]), strict=True):
        np.savetxt(log, values, fmt="%.7g")
    found = recognise(logs, period=0.01)
    assert found.joined
    assert [(one.role, one.column) for one in found.recognition.guesses] == [
        ("command", "lift_joystick.0"), ("position", "boom_angle_rad.0")
    ]  # fmt: skip
    assert found.recognition.base.time.period == 0.01
    np.savetxt(logs[0], c["u"][1:], fmt="%.7g")
    assert not _are_signals([read_table(log) for log in logs])


def test_a_variable_of_one_name_in_each_file_is_the_signal_that_the_file_is_called(record, tmp_path):
    """As MATLAB saves one series after another: two of them may be commands."""
    c = _columns(record)
    files = {"speed": np.gradient(c["q"], c["t"]), "voltage": c["u"], "current": 0.5 * c["u"]}
    for name, values in files.items():
        savemat(tmp_path / f"{name}.mat", {"data": {"Time": c["t"], "Data": values}})
    found = recognise([tmp_path / f"{name}.mat" for name in files])
    assert found.joined
    assert [(one.role, one.column) for one in found.recognition.guesses] == [
        ("command", "voltage.data.Data"), ("velocity", "speed.data.Data")
    ]  # fmt: skip
    for k in (1, 2):
        savemat(tmp_path / f"speed{k}.mat", {"data": {"Time": c["t"], "Data": c["u"]}})
    assert not _are_signals([read_table(tmp_path / f"speed{k}.mat") for k in (1, 2)])


@pytest.mark.parametrize(
    "names", [("up_torque", "up_speed", "down_torque", "down_speed"), ("tau1", "speed1", "tau2", "speed2")]
)
def test_files_of_several_records_with_a_signal_each_are_told_apart(record, tmp_path, names):
    c = _columns(record)
    speed = np.gradient(c["q"], c["t"])
    files = []
    for name in names:
        signal, values = ("speed", speed) if "speed" in name else ("torque", c["u"])
        files.append(_write(tmp_path / f"{name}.csv", f"t,{signal}", c["t"], values))
    with pytest.raises(InputError, match="those of 2 records with 2 files each") as refused:
        recognise(files)
    assert f"start {files[0]} {files[1]}`" in str(refused.value)
    assert recognise(files[:2]).joined


def test_series_of_several_records_that_only_the_files_name_are_told_apart(record, tmp_path):
    c = _columns(record)
    logs = [tmp_path / f"run{run}_{name}.t" for run in (1, 2) for name in ("tau", "pos")]
    for log in logs:
        np.savetxt(log, np.column_stack([c["t"], c["u"] if "tau" in log.name else c["q"]]), fmt="%.7g")
    with pytest.raises(InputError, match="those of 2 records with 2 files each"):
        recognise(logs)
    assert recognise(logs[:2]).joined


def test_runs_in_one_file_become_records_and_text_between_is_left_out(record, tmp_path):
    c = _columns(record)
    rows = [f"{int(1e3 * t)},{u:.7g},{q:.7g}" for t, u, q in zip(c["t"], c["u"], c["q"], strict=True)]
    half = len(rows) // 2
    first = int(rows[half].split(",")[0])
    second = [f"{int(row.split(',')[0]) - first},{row.split(',', 1)[1]}" for row in rows[half:]]
    text = ["motor 3 ready", "ms,torque,angle", *rows[:half], "second test", "ms,torque,angle", *second, "DONE"]
    (tmp_path / "serial.txt").write_text("\n".join(text))
    begun = idloop.start(tmp_path / "serial.txt", tmp_path / "begun")
    assert [bag.name for bag in begun.bags] == ["serial_run1", "serial_run2"]
    assert begun.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)
    assert any("of text between the rows" in note for note in begun.log.recognition.table.notes)


def test_forces_are_in_units_of_a_command_that_is_no_force(record, tmp_path):
    c = _columns(record)
    begun = idloop.start(_write(tmp_path / "log.csv", "t,voltage,q", c["t"], 4.0 * c["u"], c["q"]), tmp_path / "begun")
    values = begun.fit.values
    assert set(values) == {"axis.inertia", "axis.viscous_friction"}
    assert values["axis.inertia"] == pytest.approx(4.0 * 0.01, rel=0.05)
    assert values["axis.viscous_friction"] == pytest.approx(4.0 * 0.05, rel=0.05)


def test_a_record_that_cannot_be_fitted_says_why_and_is_written_all_the_same(tmp_path):
    t = np.arange(300) * 0.01
    log = _write(tmp_path / "log.csv", "t,torque,angle", t, 0 * t + 1.0, np.maximum(t - 1.0, 0.0) ** 2)
    begun = idloop.start(log, tmp_path / "begun")
    assert begun.fit is None
    assert "constant" in begun.not_fitted
    assert (tmp_path / "begun" / "model.yaml").exists()


def test_nothing_is_written_where_something_is_there_or_missing(record, tmp_path):
    c = _columns(record)
    log = _write(tmp_path / "log.csv", "t,torque,angle", c["t"], c["u"], c["q"])
    (tmp_path / "there").mkdir()
    with pytest.raises(InputError, match="exists already"):
        idloop.start(log, tmp_path / "there")
    with pytest.raises(InputError, match="no column 'angel'"):
        idloop.start(log, tmp_path / "other", {"position": "angel"})
    with pytest.raises(InputError, match="no signal 'speed'; known are time, command"):
        idloop.start(log, tmp_path / "other", {"speed": "angle"})
    assert not (tmp_path / "other").exists()


def _fitted(path, header, record, **columns):
    return _write(path, header, *({**_columns(record), **columns}[name] for name in "tuq"))


def test_a_motion_that_does_not_follow_the_command_is_not_fitted(record, tmp_path):
    other = np.random.default_rng(0).permutation(record.input)
    begun = idloop.start(_fitted(tmp_path / "log.csv", "t,voltage,q", record, u=other), tmp_path / "begun")
    assert begun.fit is None
    assert "does not follow the command" in begun.not_fitted
    assert "--command COLUMN" in begun.not_fitted
    assert not (tmp_path / "begun" / "fitted.yaml").exists()
    assert begun.commands == []


def test_a_joint_of_several_may_be_one_of_an_arm(record, tmp_path):
    """Gravity and the other joints move it more than its own torque."""
    shuffled = np.random.default_rng(0).permutation(record.input)
    columns = {"t [s]": record.time}
    for k in (1, 2, 3):
        motion = record.output[:, 0] if k == 1 else 0.1 * np.sin(k * record.time)
        columns |= {f"q{k} [rad]": motion, f"tau{k} [Nm]": shuffled}
    log = _write(tmp_path / "log.csv", ",".join(columns), *columns.values())
    begun = idloop.start(log, tmp_path / "begun")
    assert begun.log.recognition.joints == ("1", "2", "3")
    assert begun.fit is None
    assert "one of 3 joints" in begun.not_fitted
    assert "`idloop robot`" in begun.not_fitted
    assert "does not follow" not in begun.not_fitted


def test_a_motion_that_follows_is_not_said_to_be_none(record, tmp_path):
    """Where the acceleration grows with the command beyond doubt, the model is wrong and not the command."""
    begun = idloop.start(_fitted(tmp_path / "log.csv", "t,torque,q", record), tmp_path / "begun")
    failed = FirstFit(idloop.load_model("axis"), why_not="no", unmoved=True)
    found = more_than_one_axis(failed, begun.inspections, ())
    assert not found.unmoved
    assert found.why_not.startswith("the measured motion follows the command")
    still = replace(begun.inspections[0], axes=())
    assert more_than_one_axis(failed, [still], ()) is failed


def test_values_that_describe_nothing_are_no_fit(record):
    model = idloop.load_model("axis").with_free(["axis.viscous_friction"])
    found = idloop.fit(model, record)
    done = FirstFit(model, found)
    assert judged(done).fit is found
    for stderr in (np.nan, 10.0):
        unknown = replace(found, result=replace(found.result, stderr=np.full(1, stderr)))
        assert "determine none of axis.viscous_friction" in judged(replace(done, fit=unknown)).why_not
    (compared,) = found.train
    bad = dict.fromkeys(compared.fit, -5.0)
    known = {name: getattr(compared, name) for name in ("model", "force", "time", "measured", "simulated")}
    nothing = replace(found, train=(SimpleNamespace(**known, fit=bad, fit_ahead=bad),))
    refused = judged(replace(done, fit=nothing))
    assert refused.incomplete
    assert refused.fit is None
    assert "no signal of any record better than a constant" in refused.why_not


@pytest.mark.parametrize("unit", ["N·m", "V"])
def test_a_turned_command_is_answered_with_the_option_that_turns_it(record, tmp_path, unit):
    log = _fitted(tmp_path / "log.csv", f"t,motor [{unit}],q", record, u=-record.input)
    begun = idloop.start(log, tmp_path / "begun")
    option = f"--command '-`motor [{unit}]`={unit}'"
    assert f"run again with {option}" in begun.summary()
    again = idloop.start(log, tmp_path / "again", {"command": option.split("'")[1]})
    assert again.fit is not None
    assert not again.done.reversed
    assert min(again.fit.values.values()) > 0.0


@pytest.mark.parametrize("sign", [-1, 1])
def test_the_command_of_one_drive_is_turned_in_all_its_records_or_in_none(record, tmp_path, sign):
    """Beside a turned record a short one shows no sign; one that goes the way of its command contradicts."""
    c, count = _columns(record), 90 if sign < 0 else None
    logs = [
        _write(tmp_path / "long.csv", "t,motor,q", c["t"], -c["u"], c["q"]),
        _write(tmp_path / "other.csv", "t,motor,q", *(x[:count] for x in (c["t"], sign * c["u"], c["q"]))),
    ]
    begun = idloop.start(logs, tmp_path / "begun", {"command": "motor=N·m"})
    assert begun.not_fitted.startswith("long: a positive axis.effort accelerates axis backwards")
    assert ("leave long out" in begun.not_fitted) == (sign > 0)
    assert ("run again with --command '-motor=N·m'" in begun.summary()) == (sign < 0)


def test_what_is_interrupted_leaves_nothing_in_the_way(record, tmp_path):
    log = _fitted(tmp_path / "log.csv", "t,torque,q", record)

    def interrupt(share, text):
        if text.startswith("inspecting"):
            assert (tmp_path / "begun" / "mapping.yaml").exists()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        idloop.start(log, tmp_path / "begun", progress=interrupt)
    assert not (tmp_path / "begun").exists()
    assert idloop.start(log, tmp_path / "begun", fitted=False).folder.exists()


def test_complete_files_with_different_columns_are_doubted(record, tmp_path):
    c = _columns(record)
    logs = [
        _write(tmp_path / "one.csv", "t,torque,angle", c["t"], c["u"], c["q"]),
        _write(tmp_path / "two.csv", "time,current,speed", c["t"] + 500.0, c["u"], c["w"]),
    ]
    doubts = recognise(logs).doubts
    assert any("one.csv and two.csv have a command and a motion each" in text for text in doubts)
    assert any("have little or nothing in common" in text for text in doubts)
    parts = [
        _write(tmp_path / "drive.csv", "t,torque", c["t"], c["u"]),
        _write(tmp_path / "encoder.csv", "time,angle", c["t"], c["q"]),
    ]
    assert recognise(parts).between == ()


def test_a_file_that_alone_would_be_read_otherwise_is_doubted(record, tmp_path):
    c = _columns(record)
    logs = [
        _write(tmp_path / "run1.csv", "t,torque,q,w", c["t"], c["u"], c["q"], c["w"]),
        _write(tmp_path / "run2.csv", "t,torque,q,w", c["t"], c["u"], c["q"], 0.0 * c["w"]),
    ]
    found = recognise(logs)
    assert found.between == ("run2.csv is read as run1.csv; alone it would have other signals (velocity: none)",)
    begun = idloop.start(logs, tmp_path / "begun")
    assert begun.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)


def test_what_one_file_shows_of_the_encoder_holds_for_the_others(record, tmp_path):
    t = np.arange(0.0, 8.0, 0.01)
    u = np.sign(np.sin(t))
    logs = [
        _write(tmp_path / "run1.csv", "ms,torque,enc", 1e3 * t, u, np.round(50 + 40 * np.sin(t)), form="{:.0f}"),
        _write(tmp_path / "run2.csv", "ms,torque,enc", 1e3 * t, u, np.round(1500 * t) % 4096, form="{:.0f}"),
    ]
    found = recognise(logs)
    positions = [one.of("position") for one in found.recognitions]
    assert [one.options.get("wrap") for one in positions] == [positions[1].options["wrap"]] * 2


def test_runs_pieces_and_empty_columns_are_said(record, tmp_path):
    c = _columns(record)
    rows = [f"{t:.3f},{u:.6g},{q:.6g},," for t, u, q in zip(c["t"][:400], c["u"], c["q"], strict=False)]
    text = ["t,torque,angle,spare,note", *rows, *rows[:3], *rows]
    (tmp_path / "log.csv").write_text("\n".join(text))
    found = recognise(tmp_path / "log.csv")
    assert found.notes == [
        "log.csv: the time starts again in row 403: 2 records, which become a bag each",
        "log.csv: 3 rows are left out: the time starts again there, and what follows is too short for a record",
    ]
    lines = list(found.blocks())
    assert "empty: spare, note" in lines
    assert not any(str(line).startswith("not used") for line in lines)
    (tmp_path / "log.csv").write_text("\n".join([*text[:401], *(["0,0,0,,"] * 50)]))
    found = recognise(tmp_path / "log.csv")
    assert found.notes == ["log.csv: 50 rows are left out from row 400 on: the time is 0 s in all of them"]


def test_a_record_too_short_for_a_fit_does_not_spoil_the_others(record, tmp_path):
    c = _columns(record)
    rows = [f"{t:.3f},{u:.6g},{q:.6g}" for t, u, q in zip(c["t"], c["u"], c["q"], strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["t,torque,angle", *rows, *rows[:15]]))
    begun = idloop.start(tmp_path / "log.csv", tmp_path / "begun")
    assert begun.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)
    assert "left out of the fit, which needs 20 samples: log_run2 (15 samples)" in begun.summary()
    assert not any("log_run2" in command for command in begun.commands)


def test_the_held_gain_and_the_verdict_stand_beside_the_fit(record, tmp_path):
    begun = idloop.start(_fitted(tmp_path / "log.csv", "t,voltage,q", record), tmp_path / "begun")
    text = begun.summary()
    assert begun.to_dict()["verdict"] in text
    assert (
        "drive.gain is held at 1 N·m/V: a command in V is no force, so every N·m of this model is the force of 1 V"
        in text
    )
    assert "verdict: the model describes what was recorded" in text
    assert "MODEL BAG" not in text
    force = idloop.start(_fitted(tmp_path / "force.csv", "t,torque,q", record), tmp_path / "force")
    assert "is held at" not in force.summary()


def test_several_files_are_named_by_what_their_names_share(record, tmp_path):
    def name(*files):
        return Log(tuple(tmp_path / file for file in files), ()).name

    assert name("drive log.csv") == "drive_log"
    assert name("step_0.csv", "step_1.csv", "step_2.csv") == "step"
    assert name("drive.csv", "encoder.csv") == "drive_encoder"
    assert name("pendulum_sin_1V.csv", "pendulum_step_2V.csv") == "pendulum"
    assert name("MotorStairUp.mat", "MotorStairDown.mat") == "MotorStair"
    assert name("runA.csv", "runB.csv") == "run"
    assert name("a.csv", "b.csv", "c.csv") == "a_and_2_more"


def test_the_fit_is_that_of_the_mapping_that_was_shown(record, tmp_path):
    c = _columns(record)
    log = _write(tmp_path / "log.csv", "a,b,q", c["u"], 1e-3 * c["u"], np.degrees(c["q"]))
    given = {"command": "b=V", "position": "q=deg"}
    found = recognise(log, given, period=0.01)
    begun = begin(found, tmp_path / "begun")
    mapping = load_mapping(tmp_path / "begun" / "mapping.yaml")
    shown = {one.role: (one.column, one.unit) for one in found.recognition.guesses}
    assert (mapping.command[0].column, mapping.command[0].unit) == shown["command"]
    assert (mapping.position[0].column, mapping.position[0].unit) == shown["position"]
    assert mapping.time.period == 0.01
    import_bag(log, tmp_path / "bag", tmp_path / "begun" / "mapping.yaml")
    assert idloop.fit(begun.model, idloop.read_bags(tmp_path / "bag", begun.model)).values == begun.fit.values


def test_a_record_that_moves_by_noise_alone_is_not_fitted(tmp_path):
    t = np.arange(0.0, 10.0, 0.01)
    noise = np.random.default_rng(1).normal(0.0, 1e-4, t.size)
    log = _write(tmp_path / "log.csv", "t,current_A,q", t, 1e-3 * np.sign(np.sin(t)), noise)
    begun = idloop.start(log, tmp_path / "begun")
    assert begun.fit is None
    assert begun.not_fitted
    assert "describes what was recorded" not in begun.summary()
    # Nor is a fit offered where none was asked for.
    unasked = idloop.start(log, tmp_path / "unasked", fitted=False)
    assert [shlex.split(line)[1] for line in unasked.commands] == ["inspect"]


def test_no_fit_is_offered_of_records_that_are_too_short_for_one(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("t,u,v\n0,1,0\n1,1,1\n2,1,2\n0,2,0\n1,2,1\n2,2,2\n", encoding="utf-8")
    begun = idloop.start(log, tmp_path / "begun", fitted=False)
    assert [shlex.split(line)[1] for line in begun.commands] == ["inspect", "inspect"]


def test_what_to_run_next_can_be_run(record, tmp_path):
    log = _fitted(tmp_path / "log.csv", "t,torque,q", record)
    folder = tmp_path / "my axis"
    begun = idloop.start(log, folder, fitted=False)
    assert [shlex.split(line) for line in begun.commands] == [
        ["idloop", "inspect", str(folder / "bags" / "log")],
        ["idloop", "fit", str(folder / "model.yaml"), str(folder / "bags" / "log")],
    ]
    undriven = idloop.start(log, tmp_path / "undriven", {"command": "none"})
    assert [line.split()[1] for line in undriven.commands] == ["inspect"]


def test_a_data_frame_is_answered_with_what_to_do():
    with pytest.raises(InputError, match="to_csv"):
        idloop.start(SimpleNamespace(columns=["t", "u"]))


def test_records_of_two_machines_are_not_fitted_together(record, tmp_path):
    c = _columns(record)
    logs = [
        _write(tmp_path / "one.csv", "t,torque,angle", c["t"], c["u"], c["q"]),
        _write(tmp_path / "two.csv", "t,torque,angle", c["t"], c["u"], c["q"]),
        _write(tmp_path / "odd.csv", "t,torque,angle", c["t"], 2.0 * c["u"], c["q"]),
    ]
    begun = idloop.start(logs, tmp_path / "begun")
    assert begun.fit is None
    assert [(one.kind, one.where) for one in begun.between] == [("other_gain", "odd")]
    text = begun.summary()
    # As the inspection of all says it.
    assert f"warning: {begun.between[0].text}" in text
    assert "not fitted: the records do not belong together: axis: the same command accelerates 0.5 times" in text
    folder = tmp_path / "begun"
    assert [shlex.split(line)[1:] for line in begun.commands] == [
        ["inspect", *(str(folder / "bags" / name) for name in ("one", "two", "odd"))],
        ["fit", str(folder / "model.yaml"), *(str(folder / "bags" / name) for name in ("one", "two"))],
        ["fit", str(folder / "model.yaml"), str(folder / "bags" / "odd")],
    ]
    assert begun.to_dict()["between"][0]["kind"] == "other_gain"
    model = idloop.load_model(folder / "model.yaml")
    alone = idloop.fit(model, idloop.read_bags(begun.bags[:2], model))
    assert alone.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)


def test_a_record_that_spoils_a_fit_is_to_be_left_out(record, tmp_path):
    c = _columns(record)
    logs = [
        _write(tmp_path / "good.csv", "t,torque,angle", c["t"], c["u"], c["q"]),
        _write(tmp_path / "abs.csv", "t,torque,angle", c["t"], np.abs(c["u"]), c["q"]),
    ]
    begun = idloop.start(logs, tmp_path / "begun")
    assert begun.fit is None
    assert begun.not_fitted.startswith("abs: ")
    assert begun.not_fitted.endswith("; leave abs out, as the last command below does")
    folder = tmp_path / "begun"
    fit = ["idloop", "fit", str(folder / "model.yaml"), str(folder / "bags" / "good")]
    assert shlex.split(begun.commands[-1]) == fit


def test_a_file_that_is_not_recognised_beside_others_is_to_be_left_out(record, tmp_path):
    c = _columns(record)
    good = _write(tmp_path / "good.csv", "t,a,angle", c["t"], c["u"], c["q"])
    dead = _write(tmp_path / "dead.csv", "t,a,angle", 0.0 * c["t"], c["u"], c["q"])
    recognise(good)
    with pytest.raises(InputError) as alone:
        recognise(dead)
    with pytest.raises(InputError) as beside:
        recognise([dead, good])
    assert str(beside.value).startswith(str(alone.value))
    assert str(beside.value).endswith(f"leave dead.csv out, with the options as they are: idloop start {good}")


def test_every_record_has_its_line_also_where_nothing_is_fitted(record, tmp_path):
    other = np.random.default_rng(0).permutation(record.input)
    begun = idloop.start(_fitted(tmp_path / "log.csv", "t,voltage,q", record, u=other), tmp_path / "begun")
    assert begun.fit is None
    inspection = begun.inspections[0]
    assert f"log: {inspection.grade}" in begun.summary()


def test_values_that_leave_the_force_and_the_motion_unexplained_are_no_fit(record):
    model = idloop.load_model("axis").with_free(["axis.viscous_friction"])
    found = idloop.fit(model, record)
    done = FirstFit(model, found)
    one = found.train[0]
    still = np.zeros_like(one.simulated)

    def refused(simulated, relative):
        changed = SimpleNamespace(
            fit=one.fit, fit_ahead=one.fit_ahead, model=one.model, time=one.time, measured=one.measured,
            simulated=simulated, force=replace(one.force, relative=relative),
        )  # fmt: skip
        return judged(replace(done, fit=replace(found, train=(changed,)))).why_not

    # Play, for one, hides the force, but the motion follows.
    assert refused(one.simulated, 3.0) == ""
    assert refused(still, 0.6) == ""
    assert "force error is 300 %" in refused(still, 3.0)
    assert "off by more than twice" in refused(-4.0 * one.measured, 0.6)
    # That of an arm under gravity goes anywhere, however well its forces are known.
    assert refused(-4.0 * one.measured, 0.05) == ""
    # A free run that is worse than a constant stands only where the force shows what the values are worth.
    assert "worse than a constant, and the force error is 84" in refused(-0.5 * one.measured, 0.84)
    assert refused(-0.5 * one.measured, 0.6) == ""


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"position": "q=rpm"}, "^position=rpm: rpm is not a unit of a position"),
        ({"position": "u", "command": "u"}, "^the position and the command are both to be 'u'"),
        ({"time": "u"}, "'u' is no time: from row to row it rises"),
        ({"time": "still"}, "'still' is no time"),
    ],
)
def test_what_is_given_and_cannot_be_is_one_line(record, tmp_path, given, message):
    c = _columns(record)
    log = _write(tmp_path / "log.csv", "t,u,q,still", c["t"], c["u"], c["q"], 0.0 * c["t"])
    with pytest.raises(InputError, match=message) as refused:
        recognise(log, given)
    assert "\n" not in str(refused.value)


def test_a_joint_without_a_name_is_refused_in_the_words_of_the_option(record, tmp_path):
    log = _fitted(tmp_path / "log.csv", "t,torque,q", record)
    with pytest.raises(InputError, match="--joint"):
        idloop.start(log, tmp_path / "begun", joint="")


def test_a_column_that_never_changes_says_so(record, tmp_path):
    c = _columns(record)
    log = _write(tmp_path / "log.csv", "t,torque,angle,velocity", c["t"], c["u"], c["q"], 0.0 * c["t"] + 0.3)
    found = recognise(log)
    assert found.recognition.of("velocity") is None
    assert found.unused == ["not used: velocity (never changes)"]
    assert "not used: velocity (never changes)" in list(found.blocks())


def test_a_column_of_text_with_the_name_of_a_signal_says_so_before_others(record, tmp_path):
    c = _columns(record)
    log = tmp_path / "log.csv"
    rows = "\n".join(f"{t},{u},{q},free,on,a;b" for t, u, q in zip(c["t"], c["u"], c["q"], strict=True))
    log.write_text(f"t,torque,angle,note,mode,velocity\n{rows}\n")
    text = "its cells are text"
    assert recognise(log).unused == [f"not used: velocity ({text}), note ({text}), mode ({text})"]


def test_a_set_point_of_the_position_is_not_fitted_as_a_force(record, tmp_path):
    c = _columns(record)
    log = _write(tmp_path / "log.csv", "t,command,angle", c["t"][:-4], c["q"][4:], c["q"][:-4])
    begun = idloop.start(log, tmp_path / "begun")
    assert begun.fit is None
    assert begun.not_fitted.startswith("log: axis.effort is a set-point of the position")
    assert "record the current or the torque" in begun.summary()
    # The faults name the command by its topic.
    assert "axis.effort is the command, 'command' of the log" in begun.summary().splitlines()


def test_a_cure_in_the_mapping_is_followed_by_the_file_and_the_command(record, tmp_path):
    from idloop.cli import main

    c = _columns(record)
    log = _write(tmp_path / "log.csv", "t,torque,angle,speed", c["t"], c["u"], c["q"], 1.15 * c["w"])
    begun = idloop.start(log, tmp_path / "begun", {"velocity": "speed=rad/s"})
    mapping = tmp_path / "begun" / "mapping.yaml"
    assert begun.inspections[0].left_out == ("axis.velocity",)
    (line,) = [line for line in begun.summary().splitlines() if line.startswith("the mapping is ")]
    assert line.startswith(f"the mapping is {mapping}: change it there, then idloop import --map ")
    text = mapping.read_text()
    mapping.write_text(text.replace("column: speed,", "column: speed, scale: 0.8696,"))
    assert mapping.read_text() != text
    assert main.run(shlex.split(line.partition(", then idloop ")[2])) == 0
    assert idloop.records.inspect_bag(tmp_path / "begun" / "bags" / "log_changed").left_out == ()
    # Without such a cure the mapping is one of the files that were written.
    sound = idloop.start(_fitted(tmp_path / "sound.csv", "t,torque,q", record), tmp_path / "sound", fitted=False)
    assert "change it there" not in sound.summary()


def test_a_record_with_a_dead_sensor_is_to_be_left_out(record, tmp_path):
    c = _columns(record)
    half = c["t"].size // 2
    logs = [
        _write(tmp_path / "good.csv", "t,torque,angle,speed", *(c[k][:half] for k in "tuqw")),
        _write(tmp_path / "dead.csv", "t,torque,angle,speed", *(c[k][half:] for k in "tu"), 0.0 * c["q"][half:] + 1.2,
               c["w"][half:]),
    ]  # fmt: skip
    begun = idloop.start(logs, tmp_path / "begun")
    assert begun.fit is None
    assert "dead: axis.position stays at 1.2 while" in begun.not_fitted
    assert begun.not_fitted.endswith("; leave dead out, as the last command below does")
    assert begun.commands[-1].endswith(f"fit {tmp_path}/begun/model.yaml {tmp_path}/begun/bags/good")


def test_a_record_with_a_dead_sensor_and_a_held_command_is_to_be_left_out(tmp_path):
    t = np.arange(0.0, 3.0, 0.01)
    settled = 1.0 - np.exp(-5.0 * t)
    noise = np.random.default_rng(0).normal(size=(2, t.size)) * 1e-3
    logs = []
    for u in (-2.0, 1.0, 3.0):
        angle, speed = 40.0 * u * (t - 0.2 * settled) + noise[0], 40.0 * u * settled + noise[1]
        if u == 1.0:
            # Alone, a constant command is what is wrong with it: the motion begins later.
            angle, speed = 0.0 * angle, np.where(t < 0.2, noise[1], np.roll(speed, 20))
        logs.append(_write(tmp_path / f"held{len(logs)}.csv", "t,torque,angle,speed", t, 0 * t + u, angle, speed))
    begun = idloop.start(logs, tmp_path / "begun")
    assert begun.fit is None
    assert begun.not_fitted.endswith("; leave held1 out, as the last command below does")
    assert begun.commands[-1].endswith("bags/held0 " + str(tmp_path / "begun/bags/held2"))


def test_a_file_that_cannot_be_read_beside_others_is_to_be_left_out(record, tmp_path):
    c = _columns(record)
    good = _write(tmp_path / "good.csv", "t,u,q", c["t"], c["u"], c["q"])
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(InputError, match=f"leave empty.csv out, with the options as they are: idloop start {good}$"):
        recognise([tmp_path / "empty.csv", good])


def test_a_command_without_its_sign_is_answered_with_the_formula_that_gives_it(record, tmp_path):
    c = _columns(record)
    log = _write(tmp_path / "log.csv", "t,torque,q,high", c["t"], np.abs(c["u"]), c["q"], np.sign(c["u"]))
    begun = idloop.start(log, tmp_path / "begun", {"command": "torque"})
    assert "run again with --command 'torque * sign(COLUMN)=N·m'" in begun.summary()
    assert "where it had the sign of the control error" not in begun.summary()
    again = idloop.start(log, tmp_path / "again", {"command": "torque * sign(high)=N·m"})
    assert again.fit is not None


def test_a_command_without_its_sign_in_a_loop_has_that_of_the_control_error(tmp_path):
    """The size of the command of a proportional loop; the axis stands still where it is zero."""
    rng = np.random.default_rng(4)
    wanted, place, speed, rows = 0.0, 0.0, 0.0, []
    for k in range(3000):
        wanted = rng.uniform(-3.0, 3.0) if k % 150 == 0 else wanted
        command = np.clip(2.0 * (wanted - place), -1.0, 1.0) * (abs(wanted - place) > 0.02)
        rows.append((0.01 * k, wanted, abs(command), place))
        before, speed = speed, 0.9 * speed + 0.2 * command
        place += 0.005 * (before + speed)
    log = _write(tmp_path / "log.csv", "t [s],Target,MotorPWM,angle [rad]", *np.array(rows).T)
    begun = idloop.start(log, tmp_path / "begun", {"reference": "Target=rad"})
    (flag,) = re.findall(r"sign of the control error, run again with --command '(.*?)' and", begun.summary())
    assert flag == "MotorPWM * sign(Target - `angle [rad]`)=-"
    again = idloop.start(log, tmp_path / "again", {"reference": "Target=rad", "command": flag})
    assert again.inspections[0].faults == ()
    assert again.fit.values["axis.inertia"] == pytest.approx(0.05, rel=0.1)


def test_a_doubt_that_is_answered_in_the_mapping_names_it(record, tmp_path):
    c = _columns(record)
    head = "ms_today,input_voltage,temp_mos_max,current_motor,current_in,erpm,duty_cycle"
    steady = [0.0 * c["t"] + value for value in (24.0, 30.0)]
    columns = (1e3 * c["t"], *steady, c["u"], c["u"], c["w"] * 30 / np.pi, c["u"])
    begun = idloop.start(_write(tmp_path / "log.csv", head, *columns), tmp_path / "begun", fitted=False)
    assert any("set its `scale:` in the mapping to 1 divided by their number" in one for one in begun.log.doubts)
    assert f"the mapping is {tmp_path}/begun/mapping.yaml: change it there" in begun.summary()


@pytest.mark.parametrize(("command", "kind"), [("goal=deg", "position_loop"), ("goal=rpm", "velocity_loop")])
def test_a_set_point_gets_a_model_of_the_loop_in_the_drive(command, kind, tmp_path):
    """A servo of the inertia 1 with a gain of 400 per second squared, or of 20 per second, that acts 20 ms late."""
    random, time = np.random.default_rng(5), np.arange(0.0, 15.0, 0.01)
    goal = np.interp(time, np.arange(0.0, 16.0, 0.5), random.uniform(-60.0, 60.0, 32))
    model = idloop.load_model("axis")
    drive = {"kind": kind, "proportional": 400.0 if kind == "position_loop" else 20.0}
    model = _with_drive(model, drive, "rad" if kind == "position_loop" else "rad/s")
    model = model.with_effects(["input_delay@input(delay=0.02)"])
    factor = np.pi / 180.0 if kind == "position_loop" else 2.0 * np.pi / 60.0
    moved = idloop.physics.simulate(model, time, factor * goal, time).output
    moved = moved[:, 0] / factor if kind == "position_loop" else moved[:, 1] / factor
    moved += random.normal(0.0, 0.02, len(time))
    field = "position=q=deg" if kind == "position_loop" else "velocity=q=rpm"
    role, _, column = field.partition("=")
    log = _write(tmp_path / "servo.csv", "t,goal,q", time, goal, moved, form="{:.4f}")
    given = {"command": command, role: column}
    done = begin(recognise([log], given), tmp_path / "servo")
    fitted = done.fit
    assert fitted is not None
    assert fitted.model.loop.effect.name == kind
    assert fitted.values["drive.proportional"] == pytest.approx(drive["proportional"], rel=0.05)
    assert fitted.values["input_delay@input.delay"] == pytest.approx(0.02, abs=0.002)
    if kind == "position_loop":
        # Its braking and viscous friction are one until a limit is reached.
        assert fitted.values["drive.derivative"] == pytest.approx(10.0, rel=0.05)
        assert "axis.viscous_friction" not in fitted.model.free
    assert "input_delay" not in done.summary().partition("larger by a factor, ")[2].partition(" larger")[0]


def _with_drive(model, drive, unit):
    from idloop.physics.model_file import build_model, to_mapping
    from idloop.physics.schema import ModelFile

    file = to_mapping(model)
    file["drive"] = drive
    file["input"]["unit"] = unit
    file["bodies"] = [{"name": "axis", "inertia": 1.0, "viscous_friction": 10.0 if unit == "rad" else 0.5}]
    return build_model(ModelFile.model_validate(file), "servo")


def test_the_cause_of_a_fit_that_describes_nothing_is_a_fault_that_spoils_something():
    lost = Finding("lost_samples", "5 samples are missing; record faster", level="warning", cure="record faster")
    turned = Finding("turned_command", "it accelerates backwards", level="warning", spoils=("identification",))
    inspections = [SimpleNamespace(faults=(lost,)), SimpleNamespace(faults=(lost, turned))]
    failed = FirstFit(idloop.load_model("axis"), why_not="nothing is described", incomplete=True)
    said = "; or what the inspection names is the cause: "
    found = with_causes(failed, inspections, "")
    assert found.why_not == f"nothing is described{said}it accelerates backwards"
    assert with_causes(failed, inspections[:1], "").why_not == "nothing is described"


def test_a_command_that_was_recorded_late_is_mended_by_the_option_that_is_printed(record, tmp_path):
    c = _columns(record)
    late = np.concatenate([np.full(8, c["u"][0]), c["u"][:-8]])
    log = _write(tmp_path / "log.csv", "t_s,torque_Nm,angle_rad", c["t"], late, c["q"])
    assert "run again with --late 0.08 and" in idloop.start(log, tmp_path / "begun").summary()
    again = idloop.start(log, tmp_path / "again", late=0.08)
    assert again.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)


def _pieces(said, middle):
    """The rows of two recordings in one, by the options that are printed; one begins after the other."""
    printed = re.search(r"run again with --rows (\S+) --rows (\S+) and", said).groups()
    first, second = (slice(*map(int, one.split(":"))) for one in printed)
    assert first.start == 0
    assert first.stop <= middle < second.start + 2
    return [first, second]


def test_recordings_in_one_file_are_cut_apart_by_the_options_that_are_printed(record, tmp_path):
    c = _columns(record)
    place, middle = c["q"] + np.where(c["t"] < 7.5, 0.0, 0.2 * np.ptp(c["q"])), c["t"].size // 2
    log = _write(tmp_path / "log.csv", "t_s,torque_Nm,angle_rad", c["t"], c["u"], place)
    said = idloop.start(log, tmp_path / "begun", fitted=False).summary()
    pieces = _pieces(said, middle)
    again = idloop.start(log, tmp_path / "again", rows=pieces)
    assert [bag.name for bag in again.bags] == ["log_run1", "log_run2"]
    assert [one.grade for one in again.inspections] == ["usable", "usable"]
    assert again.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)


def test_all_times_in_which_a_sensor_stood_still_are_left_out(record, tmp_path):
    c = _columns(record)
    place, speed, quarter = c["q"].copy(), np.gradient(c["q"], c["t"]), c["t"].size // 4
    for signal, start in ((place, quarter), (speed, 3 * quarter)):
        signal[start : start + 150] = signal[start]
    log = _write(tmp_path / "log.csv", "t_s,torque_Nm,angle_rad,speed_rad_s", c["t"], c["u"], place, speed)
    said = idloop.start(log, tmp_path / "begun", fitted=False).summary()
    assert re.search(r"run again with --rows 0:\d+ --rows \d+:\d+ --rows \d+:\d+ and", said), said


def test_exchanged_columns_of_command_and_velocity_are_said_with_the_options_that_mend_it(record, tmp_path):
    c = _columns(record)
    log = _write(tmp_path / "log.csv", "t_s,torque_Nm,angle_rad,speed_rad_s", c["t"], c["w"], c["q"], c["u"])
    begun = idloop.start(log, tmp_path / "begun")
    assert begun.fit is None
    assert "--command 'speed_rad_s=N·m' --velocity 'torque_Nm=rad/s'" in begun.summary()
    given = {"command": "speed_rad_s=N·m", "velocity": "torque_Nm=rad/s"}
    again = idloop.start(log, tmp_path / "again", given)
    assert again.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize("rows", [slice(20, 20), slice(5000, None)])
def test_rows_that_hold_nothing_are_refused(record, tmp_path, rows):
    c = _columns(record)
    log = _write(tmp_path / "log.csv", "t_s,torque_Nm,angle_rad", c["t"], c["u"], c["q"])
    with pytest.raises(InputError, match=r"holds nothing: the table has \d+ rows"):
        recognise(log, rows=[rows])


@pytest.mark.parametrize(("bits", "unit"), [(16, "ms"), (32, "us")])
def test_a_counter_of_the_time_that_is_full_is_said_to_be(record, tmp_path, bits, unit):
    c = _columns(record)
    ticks = (np.round(c["t"] * (1e3 if unit == "ms" else 1e6)) + 0.6 * 2**bits).astype(np.int64)
    ticks += 2**bits - int(ticks[700])
    log = _write(tmp_path / "log.csv", f"t_{unit},torque_Nm,angle_rad", ticks % 2**bits, c["u"], c["q"], form="{:.12g}")
    said = recognise(log).notes
    assert f"log.csv: the counter of the time is full at {2**bits} and goes on in row 700: 2 records" in said[0]


def test_a_folder_behind_the_log_is_no_folder_to_write_to(record, tmp_path):
    c = _columns(record)
    log = _write(tmp_path / "log.csv", "t_s,torque_Nm,angle_rad", c["t"], c["u"], c["q"])
    with pytest.raises(InputError, match="give a folder to write to by --output"):
        recognise([log, tmp_path])


def test_a_sign_that_may_be_lost_is_answered_where_the_motion_follows_nothing(record, tmp_path):
    c = _columns(record)
    other = np.abs(np.random.default_rng(3).normal(size=c["t"].size))
    begun = idloop.start(_write(tmp_path / "log.csv", "t,torque,q", c["t"], other, c["q"]), tmp_path / "begun")
    assert begun.fit is None
    assert "or what the inspection names is the cause: axis.effort has no visible effect" in begun.not_fitted
    assert "run again with --command 'torque * sign(COLUMN)=N·m'" in begun.summary()


def _foreign_bag(path, record, command, place, *, later=0.5):
    """A bag of another system, whose command topic begins earlier than the motion."""
    stamp = (1e9 * (1_700_000_000.0 + record.time)).astype(np.int64)
    sent = np.concatenate([stamp[:1] - int(1e9 * later), stamp])
    streams = [
        make_stream("/drive/cmd", sent, {"m": {"effort": np.concatenate([[0.0], command])}}),
        make_stream("/drive/joint_states", stamp, {"m": {"position": place}}),
    ]
    return write_bag(path, streams)


def test_a_late_command_of_a_bag_is_mended_by_the_option_that_is_printed(record, tmp_path):
    c = _columns(record)
    late = np.concatenate([np.full(8, c["u"][0]), c["u"][:-8]])
    bag = _foreign_bag(tmp_path / "bag", record, late, c["q"])
    assert "run again with --late 0.08 and" in idloop.start(bag, tmp_path / "begun", fitted=False).summary()
    again = idloop.start(bag, tmp_path / "again", late=0.08)
    assert again.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)
    assert again.inspections[0].faults == ()


def test_a_bag_is_cut_apart_by_the_options_that_are_printed(record, tmp_path):
    c = _columns(record)
    place, middle = c["q"] + np.where(c["t"] < 7.5, 0.0, 0.2 * np.ptp(c["q"])), c["t"].size // 2
    bag = _foreign_bag(tmp_path / "bag", record, c["u"], place)
    said = idloop.start(bag, tmp_path / "begun", fitted=False).summary()
    pieces = _pieces(said, middle)
    again = idloop.start(bag, tmp_path / "again", rows=pieces)
    assert [one.name for one in again.bags] == ["bag_run1", "bag_run2"]
    assert [one.grade for one in again.inspections] == ["usable", "usable"]
    assert [one.axes[0].time.size for one in again.inspections] == [one.stop - one.start for one in pieces]
    assert again.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.05)
    with pytest.raises(InputError, match="--rows 9000: holds nothing"):
        recognise(bag, rows=[slice(9000, None)])


@pytest.mark.parametrize("sign", [1, -1])
def test_an_axis_on_a_spring_is_not_said_to_be_turned_where_the_command_gives_it_power(sign, tmp_path):
    """Below its resonance it goes the way of its force, and a model without a spring the other way."""
    rng, time = np.random.default_rng(1), np.arange(3000) / 100.0
    force = np.sum([np.sin(turns * time + turns) for turns in (0.7, 1.3, 2.1, 3.1)], axis=0)
    place, p, v = np.empty(time.size), 0.0, 0.0
    for k, u in enumerate(force):
        place[k] = p
        for _ in range(10):
            v += 0.001 * (10.0 * u - 0.5 * v - 60.0 * p)
            p += 0.001 * v
    log = _write(tmp_path / "log.csv", "t,torque,q", time, sign * force, place + 1e-4 * rng.normal(size=time.size))
    begun = idloop.start(log, tmp_path / "begun", {"position": "q=rad", "command": "torque=N·m"}, fitted=False)
    done = FirstFit(begun.model, why_not="turned", reversed=True)
    found = forwards_beside_position(done, begun.inspections)
    assert (found.reversed, found.incomplete) == ((False, True) if sign > 0 else (True, False))
    assert ("a spring or a weight is missing" in found.why_not) == (sign > 0)


def _beside_a_weight(position, force, moment):
    """An axis under a steady force or gravity, driven to and fro around its balance."""
    time = 0.004 * np.arange(2500)
    push = np.sum([np.sin(turns * time + turns) for turns in (1.3, 2.9, 5.1, 8.3)], axis=0)
    place, p, v = np.empty(time.size), position, 0.0
    pull, command = np.empty(time.size), np.empty(time.size)
    for k in range(time.size):
        place[k] = p
        pull[k] = force + moment * math.sin(p)
        command[k] = force + moment * math.sin(position) + push[k] - 8.0 * (p - position) - 2.0 * v
        for _ in range(8):
            v += 5e-4 * (command[k] - force - moment * math.sin(p) - 0.6 * v - 0.4 * math.tanh(200.0 * v)) / 0.3
            p += 5e-4 * v
    return time, command, place + 1e-5 * np.random.default_rng(3).normal(size=time.size)


@pytest.mark.parametrize(
    ("header", "force", "moment", "effect"),
    [
        ("t [s],force [N],z [m]", 20.0, 0.0, "load_torque@axis.torque"),
        ("t [s],torque [Nm],q [rad]", 0.0, 9.0, "gravity@axis.moment"),
    ],
)
def test_an_axis_that_holds_a_weight_is_fitted_with_it(tmp_path, header, force, moment, effect):
    """A command that is never zero on average leaves inertia and friction alone without any value."""
    log = _write(tmp_path / "log.csv", header, *_beside_a_weight(1.1, force, moment))
    begun = idloop.start(log, tmp_path / "begun")
    assert begun.fit is not None, begun.not_fitted
    assert abs(begun.fit.values[effect]) == pytest.approx(force + moment, rel=0.05)
    assert begun.fit.values["axis.inertia"] == pytest.approx(0.3, rel=0.1)
    assert any(f"{effect.split('.')[0]} is in the model" in line for line in begun.done.notes)
    assert begun.model.effects


def test_the_command_is_tested_once_where_no_weight_describes_the_motion(tmp_path, monkeypatch):
    """A friction damper that a test machine moves: its force is no cause of the motion, and no weight is one."""
    from idloop.api import fit

    asked = []

    def answer(*given):
        asked.append(given)
        return command_response(*given)

    monkeypatch.setattr(fit, "command_response", answer)
    time = 0.005 * np.arange(1200)
    place = np.sin(6.0 * time) * np.minimum(0.3 * time, 1.0)
    force, friction = np.empty(time.size), 0.0
    for k, moved in enumerate(np.diff(place, prepend=place[0])):
        friction = min(max(friction + moved / 0.2, -1.0), 1.0)
        force[k] = 3.0 * friction
    noise = 0.02 * np.random.default_rng(2).normal(size=time.size)
    begun = idloop.start(
        _write(tmp_path / "log.csv", "t,force [N],x [m]", time, force + noise, place), tmp_path / "out"
    )
    assert "let a diagnosis find what the model lacks" in begun.not_fitted
    assert len(asked) == 1


def test_an_arm_whose_free_run_drifts_off_is_fitted_with_gravity(tmp_path):
    """A steady force follows a slow loop of the position better than gravity in a free run, and explains no force."""
    time = 0.01 * np.arange(3000)
    place = -1.1 + 0.9 * np.sin(0.7 * time) + 0.08 * np.sin(2.9 * time + 1.0)
    speed = np.gradient(place, time)
    force = 0.9 * np.gradient(speed, time) + 2.0 * speed + 1.3 * np.tanh(100.0 * speed) - 10.5 * np.cos(place)
    current = force + 0.05 * np.random.default_rng(5).normal(size=time.size)
    log = _write(tmp_path / "log.csv", "t,current [A],q [rad],dq [rad/s]", time, current, *np.round([place, speed], 4))
    begun = idloop.start(log, tmp_path / "begun")
    assert begun.fit is not None, begun.not_fitted
    assert begun.fit.values["gravity@axis.moment"] == pytest.approx(10.5, rel=0.05)
    assert begun.fit.values["gravity@axis.lowest"] == pytest.approx(0.5 * math.pi, abs=0.05)


def _steps(tmp_path, levels, steps=15):
    """Logs of one step each, of an axis of inertia 0.01 and viscous friction 0.05 beside a coarse sensor of speed."""
    t = np.arange(0.0, 3.0, 0.005)
    logs = []
    for number, level in enumerate(levels):
        speed = level / 0.05 * -np.expm1(-5.0 * np.maximum(t - 0.3, 0.0))
        step = 2.0 / 0.05 / steps
        command = np.where(t >= 0.3, level, 0.0)
        logs.append(_write(tmp_path / f"step{number}.csv", "t,torque,speed", t, command, np.round(speed / step) * step))
    return logs


def test_levels_are_judged_over_the_records_and_one_that_hardly_moves_is_left_out(tmp_path):
    begun = idloop.start(_steps(tmp_path, [2.0, -1.2, -2.0, 0.3, 1.3]), tmp_path / "begun")
    assert begun.fit is not None
    assert begun.fit.values["axis.inertia"] == pytest.approx(0.01, rel=0.1)
    assert begun.fit.values["axis.viscous_friction"] == pytest.approx(0.05, rel=0.05)
    assert [bag.name for bag in begun.done.bags] == ["step0", "step1", "step2", "step4"]
    (note,) = (one for one in begun.done.notes if "left out of the fit" in one)
    assert note.startswith("left out of the fit: step3: axis.velocity moves by only 2 steps of the sensor")
    grades = {one.path.name: one.grade for one in begun.inspections}
    assert grades.pop("step3") == "not usable for identification"
    assert set(grades.values()) == {"usable with care"}
    assert not any("step3" in command for command in begun.commands)


def test_alone_and_beside_the_same_levels_two_levels_show_no_dead_zone(tmp_path):
    for name, levels in (("alone", [2.0]), ("alike", [2.0, 2.0])):
        folder = tmp_path / name
        folder.mkdir()
        begun = idloop.start(_steps(folder, levels), folder / "begun", fitted=False)
        kinds = {fault.kind for one in begun.inspections for fault in one.faults}
        assert "two_levels" in kinds
        assert all("dead zone" in one.grade for one in begun.inspections)


def test_predictions_ahead_are_asked_only_where_no_free_run_is_better_than_a_constant():
    class Compared(SimpleNamespace):
        @property
        def fit_ahead(self):
            assert max(self.fit.values()) < 1.0, "worked out although a free run follows"
            return self.ahead

    def predicted(free, ahead):
        return _is_predicted(SimpleNamespace(train=[Compared(fit={"q": free}, ahead={"q": ahead})]))

    assert predicted(40.0, math.nan)
    assert predicted(-300.0, 90.0)
    assert not predicted(-300.0, -5.0)
    assert not predicted(0.5, math.nan)


def test_a_command_in_another_unit_than_in_the_other_files_is_doubted(record, tmp_path):
    c = _columns(record)
    factors = {"a": 1.0, "b": 1.1, "c": 1e-3, "d": 0.9}
    logs = [
        _write(tmp_path / f"{name}.csv", "t_s,current,angle_rad", c["t"], f * c["u"], c["q"])
        for name, f in factors.items()
    ]
    (doubt,) = (one for one in recognise(logs).doubts if "another unit" in one)
    assert doubt.startswith("command: in c.csv it is about 950 times smaller than in the others")
    # One that hardly moves was commanded less.
    slow = _write(tmp_path / "c.csv", "t_s,current,angle_rad", c["t"], 1e-3 * c["u"], 1e-3 * c["q"], form="{:.9g}")
    assert not any("another unit" in one for one in recognise([logs[0], logs[1], slow, logs[3]]).doubts)
