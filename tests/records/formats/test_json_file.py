"""Samples of JSON by name, with what is within them; lines that are cut off."""

from __future__ import annotations

import json

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.formats import json_file
from idloop.records.tables.table_files import read_table

SAMPLES = [{"t": 0.1 * k, "motor": {"q": [k, -k], "state": "on"}, "u": None if k == 1 else k} for k in range(4)]


@pytest.mark.parametrize("name", ["log.json", "log.jsonl", "log.ndjson", "log.txt"])
def test_samples(tmp_path, name):
    lines = name != "log.json"
    text = "\n".join(map(json.dumps, SAMPLES)) + "\n\n" if lines else json.dumps(SAMPLES)
    (tmp_path / name).write_text(text)
    table = read_table(tmp_path / name)
    np.testing.assert_array_equal(table.numbers("motor.q[1]"), [0, -1, -2, -3])
    np.testing.assert_array_equal(table.numbers("u"), [0, np.nan, 2, 3])
    assert table.raw("motor.state") == ["on"] * 4


def test_messages_of_several_kinds_leave_cells_empty(tmp_path):
    lines = [json.dumps({"t": k, "a" if k % 2 else "b": k}) for k in range(6)]
    (tmp_path / "log.jsonl").write_text("\n".join(lines))
    table = read_table(tmp_path / "log.jsonl")
    assert table.raw("a") == [None, 1, None, 3, None, 5]
    assert table.raw("b") == [0, None, 2, None, 4, None]


def test_a_last_line_that_is_cut_off_is_left_out_and_said(tmp_path):
    (tmp_path / "log.jsonl").write_text("\n".join(map(json.dumps, SAMPLES))[:-5])
    table = read_table(tmp_path / "log.jsonl")
    assert len(table.raw("t")) == 3
    assert table.notes == ["the last line is cut off and left out"]


def test_a_bad_line_is_named(tmp_path):
    (tmp_path / "log.jsonl").write_text('{"t": 0}\n{"t": }\n{"t": 2}\n')
    with pytest.raises(InputError, match="line 2: not valid JSON"):
        read_table(tmp_path / "log.jsonl")
    (tmp_path / "log.jsonl").write_text('{"t": 0}\n3\n{"t": 2}\n')
    with pytest.raises(InputError, match="line 2 is no JSON object"):
        read_table(tmp_path / "log.jsonl", "jsonl")


def test_a_series_with_gaps_is_a_column(tmp_path):
    (tmp_path / "log.json").write_text('{"t": [0, 1, 2], "u": [1.5, null, 2], "names": ["a", "b", "c"]}')
    table = read_table(tmp_path / "log.json")
    np.testing.assert_array_equal(table.numbers("u"), [1.5, np.nan, 2.0])
    assert table.raw("names") == ["a", "b", "c"]


def test_values_that_each_sample_names_anew_are_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(json_file, "MOST_COLUMNS", 20)
    (tmp_path / "log.jsonl").write_text("".join(f'{{"k{k}": 1}}\n' for k in range(30)))
    with pytest.raises(InputError, match="more than 20 values in a sample"):
        read_table(tmp_path / "log.jsonl")


def test_samples_below_any_key_are_found(tmp_path):
    path = tmp_path / "a.json"
    samples = [{"t": 0.1 * k, "u": k % 3} for k in range(20)]
    path.write_text(json.dumps({"kp": 4.0, "motor": {"name": "m1"}, "entries": samples}))
    table = read_table(path)
    assert set(table.columns) == {"t", "u"}
    assert table.attributes["kp"] == 4.0


def test_a_unit_beside_a_series(tmp_path):
    count = list(range(20))
    series = {"time": {"unit": "ms", "data": count}, "angle": {"Einheit": "deg", "data": count}}
    (tmp_path / "log.json").write_text(
        json.dumps({"series": series, "run": {"time": count, "u": count, "units": {"u": "V"}}})
    )
    units = read_table(tmp_path / "log.json").units
    assert (units["series.time.data"], units["series.angle.data"], units["run.u"]) == ("ms", "deg", "V")
