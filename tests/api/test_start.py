"""From the files of a log to a fitted model: one step, whatever the files look like."""

from __future__ import annotations

import numpy as np
import pytest

import idloop
from idloop.errors import InputError
from idloop.records.tables.mapping import load_mapping


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


def test_only_ratios_are_estimated_where_the_command_is_no_force(record, tmp_path):
    c = _columns(record)
    begun = idloop.start(_write(tmp_path / "log.csv", "t,voltage,q", c["t"], 4.0 * c["u"], c["q"]), tmp_path / "begun")
    values = begun.fit.values
    assert set(values) == {"axis.viscous_friction", "drive.gain"}
    assert values["drive.gain"] == pytest.approx(25.0, rel=0.05)
    assert values["axis.viscous_friction"] == pytest.approx(5.0, rel=0.05)


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
