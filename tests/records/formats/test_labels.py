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
    "equals signs": "a = 1, b = 2.5\na = 2, b = -3e-1\na = 3, b = nan\n",
    "one to a line": "a: 1\nb: 2.5\na: 2\nb: -3e-1\na: 3\nb: nan\n",
    "words before and among them": "I a=1 b=2.5 mode=on\nI a=2 b=-3e-1 mode=on\nI a=3 b=nan mode=off\n",
    "a sign before each line": ">a:1,b:2.5\n>a:2,b:-3e-1\n>a:3,b:nan\n",
    "Teleplot": ">a:1\n>b:2.5\n>a:2\n>b:-3e-1\n>a:3\n>b:nan\n",
    "dictionaries of Python": "{'a': 1, 'b': 2.5}\n{'a': 2, 'b': -3e-1}\n{'a': 3, 'b': nan}\n",
    "a list of YAML": "- a: 1\n  b: 2.5\n- a: 2\n  b: -3e-1\n- a: 3\n  b: nan\n",
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
    ("line", "first"),
    [
        ("[09:00:0{k}] INFO motor: pos=1.2 vel=0.{k}", 32400.0),
        ("2025-03-02 09:00:0{k},250 - motor - INFO - pos=1.2 vel=0.{k}", "2025-03-02 09:00:00.250"),
        ("time=2025-03-02T09:00:0{k}Z level=info pos=1.2 vel=0.{k}", "2025-03-02T09:00:00Z"),
        ("[INFO] [169000000{k}.25] [motor]: pos=1.2 vel=0.{k}", 1690000000.25),
        ("[  12.{k}50000] motor: pos=1.2, vel=0.{k}", 12.05),
        ("I (123{k}) motor: pos=1.2 vel=0.{k}", 1230.0),
        ("123{k} pos=1.2 vel=0.{k}", 1230.0),
        ("Stats 1523.{k}: pos=1.2 vel=0.{k}", 1523.0),
    ],
)
def test_the_clock_before_the_values_is_the_time(tmp_path, line, first):
    path = tmp_path / "log.txt"
    path.write_text("".join(f"{line.format(k=k)}\n" for k in range(5)))
    assert form_of(path).kind == "labels"
    table = read_table(path)
    assert list(table.columns) == ["time", "pos", "vel"]
    assert table.columns["time"][0] == first
    np.testing.assert_array_equal(table.columns["vel"], [0.0, 0.1, 0.2, 0.3, 0.4])


def test_labels_with_stamps_of_their_own(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("".join(f">angle:{100 * k}:{k}§deg\n>u:{100 * k + 3}.5:{-k}|g\n>state:on|t\n" for k in range(4)))
    table = read_table(path)
    assert table.clocks == {"angle": "angle.time", "u": "u.time"}
    np.testing.assert_array_equal(table.columns["angle.time"], [0, 100, 200, 300])
    np.testing.assert_array_equal(table.columns["u.time"], [3.5, 103.5, 203.5, 303.5])
    np.testing.assert_array_equal(table.columns["u"], [0, -1, -2, -3])
    assert table.units == {"angle": "deg", "angle.time": "ms", "u.time": "ms"}
    assert table.notes == ["4 lines without labelled values are left out"]


def test_several_values_of_one_line(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("".join(f">u:{20 * k}:{k};{20 * k + 10}:{k}.5\n" for k in range(4)))
    table = read_table(path)
    np.testing.assert_array_equal(table.columns["time"], 10.0 * np.arange(8))
    np.testing.assert_array_equal(table.columns["u"], 0.5 * np.arange(8))


def test_a_value_that_was_lost_takes_no_other_into_its_row(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("a:1\nb:1\nc:1\na:2\nc:2\nb:3\nc:3\na:4\nb:4\nc:4\n")
    columns = read_table(path).columns
    np.testing.assert_array_equal(columns["a"], [1, 2, np.nan, 4])
    np.testing.assert_array_equal(columns["b"], [1, 3, np.nan, 4])
    np.testing.assert_array_equal(columns["c"], [1, 2, 3, 4])


def test_units_behind_the_values(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("".join(f"angle: {k}.5 deg speed: {k}rpm u: 0.{k} V duty=1.5 %\n" for k in range(4)))
    table = read_table(path)
    assert table.units == {"angle": "deg", "speed": "rpm", "u": "V", "duty": "%"}
    np.testing.assert_array_equal(table.columns["angle"], [0.5, 1.5, 2.5, 3.5])


@pytest.mark.parametrize(
    "text",
    ["1.5,2.5,mode:3\n" * 5, "gain: 1\nlimit: 2\nrate: 3\n", "t,u\n0,1\n1,2\n", "10:03:29,1\n10:03:30,2\n10:03:31,3\n"],
)
def test_other_texts_are_none(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text)
    assert form_of(path).kind == "csv"
