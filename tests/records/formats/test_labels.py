"""Values with labels, as a serial plotter draws them."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.formats.registry import form_of
from idloop.records.tables.table_files import read_table

LINES = {
    "commas": "a:1,b:2.5\na:2,b:-3e-1\na:3,b:nan\n",
    "blanks": "a:1 b:2.5\na:2 b:-3e-1\na:3 b:nan\n",
    "blanks behind colons": "a: 1 b: 2.5\na: 2 b: -3e-1\na: 3 b: nan\n",
    "tabs": "a:1\tb:2.5\t\na:2\tb:-3e-1\t\na:3\tb:nan\t\n",
}


@pytest.mark.parametrize("name", LINES)
def test_columns_by_label(tmp_path, name):
    path = tmp_path / "log.txt"
    path.write_text("Ready.\n" + LINES[name])
    table = read_table(path)
    np.testing.assert_array_equal(table.columns["a"], [1, 2, 3])
    np.testing.assert_array_equal(table.columns["b"], [2.5, -0.3, np.nan])
    assert table.notes == ["1 line without labelled values is left out"]


def test_a_label_that_comes_later_was_not_measured_before(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("a:1\na:2,b:5\na:3\na:4\n")
    np.testing.assert_array_equal(read_table(path).columns["b"], [np.nan, 5, np.nan, np.nan])


def test_the_clock_of_a_serial_monitor_is_the_time(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("".join(f"10:00:0{k}.500 -> angle of arm:{k},u:1\n" for k in range(5)))
    table = read_table(path)
    np.testing.assert_allclose(table.columns["time"], 36000.5 + np.arange(5))
    assert list(table.columns) == ["time", "angle of arm", "u"]


@pytest.mark.parametrize(
    "text", ["gain: 1\nlimit: 2\nrate: 3\n", "t,u\n0,1\n1,2\n", "10:03:29,1\n10:03:30,2\n10:03:31,3\n"]
)
def test_other_texts_are_none(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text)
    assert form_of(path).kind == "csv"
