"""A trace of CODESYS: each variable a column with its own stamps."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.tables.table_files import read_table

DATA = Path(os.environ.get("IDLOOP_DATA", Path(__file__).parents[4] / "shared" / "data"))
HEAD = "[key]; [value]\nVersion; 0x03050000\nName; Application.Trace\nComment; \n"


def _block(number, name, rows):
    return f"{number}.Variable; {name}\n{number}.Class; 14\n{number}.Data; \n" + "".join(
        f"; {stamp}; {value}\n" for stamp, value in rows
    )


def _write(tmp_path, text):
    path = tmp_path / "run.trace.csv"
    path.write_text(HEAD + text, encoding="utf-8")
    return path


def test_variables_with_their_stamps(tmp_path):
    text = _block(0, "GVL.speed", [(2, 1.5), (22, -2)]) + _block(
        1, "GVL.on", [(2, "TRUE"), (12, "FALSE"), (22, "TRUE")]
    )
    table = read_table(_write(tmp_path, text))
    np.testing.assert_array_equal(table.numbers("GVL.speed"), [1.5, -2.0])
    np.testing.assert_array_equal(table.numbers("GVL.on"), [1.0, 0.0, 1.0])
    np.testing.assert_array_equal(table.numbers(table.clocks["GVL.on"]), [2.0, 12.0, 22.0])
    assert table.units == {"GVL.speed.time": "ms", "GVL.on.time": "ms"}
    assert "taken as ms" in table.notes[0]


def test_variables_of_one_name(tmp_path):
    table = read_table(_write(tmp_path, _block(0, "a", [(1, 1)]) + _block(1, "a", [(1, 2)])))
    assert {"a", "a (1)"} <= set(table.columns)


@pytest.mark.parametrize("row", ["; 2; off", "; 2", "; ; 5", "; 2; "])
def test_a_damaged_row_is_named(tmp_path, row):
    with pytest.raises(InputError, match=r"line 8 of 'a' is .*, not a stamp and a value"):
        read_table(_write(tmp_path, _block(0, "a", []) + row + "\n"))


def test_a_trace_without_values_is_one_line(tmp_path):
    with pytest.raises(InputError, match="without values"):
        read_table(_write(tmp_path, _block(0, "a", [])))


def test_a_recorded_trace():
    path = DATA / "failing_inputs" / "09_formats" / "codesys.trace.csv"
    if not path.is_file():
        pytest.skip(f"no {path}")
    table = read_table(path)
    assert len(table.clocks) == 3
    for name, clock in table.clocks.items():
        assert len(table.columns[name]) == len(table.columns[clock]) > 1000
        np.testing.assert_array_equal(np.unique(np.diff(table.numbers(clock))), [20.0])
