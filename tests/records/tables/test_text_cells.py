"""Texts that are numbers: clocks, groups of thousands, words where nothing was measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from idloop.records.tables.table import Table
from idloop.records.tables.table_files import read_table, read_texts


def _read(cells, **columns):
    table = Table(Path("log.csv"), {"x": list(cells), **columns})
    read_texts(table)
    return table


CLOCKS = {
    "a time of day": (["10:03:29.5", "10:03:30.25"], [36209.5, 36210.25]),
    "milliseconds behind a semicolon": (["10:03:29;500", "10:03:30;250"], [36209.5, 36210.25]),
    "over midnight": (["23:59:59,5", "00:00:00,5"], [86399.5, 86400.5]),
    "milliseconds behind a colon": (["1:00:00:250", "1:00:00:500"], [3600.25, 3600.5]),
    "afternoon": (["12:00:01 AM", "1:00:00 PM"], [1.0, 46800.0]),
    "behind a date of any order": (["1/2/2025 00:00:01", "1/2/2025 00:00:02"], [1.0, 2.0]),
    "minutes of a spreadsheet": (["59:59.5", "00:00.5"], [3599.5, 3600.5]),
}


@pytest.mark.parametrize("name", CLOCKS)
def test_clocks_are_seconds(name):
    cells, seconds = CLOCKS[name]
    table = _read(cells)
    np.testing.assert_allclose(table.columns["x"], seconds)
    assert table.units["x"] == "s"


@pytest.mark.parametrize("cell", ["10:03", "2025-11-12T10:03:29", "2025-11-12", "25:00:00", "10:03:29 to 10:04"])
def test_other_times_stay_as_they_are(cell):
    assert _read([cell] * 3).columns["x"] == [cell] * 3


THOUSANDS = {
    "a point behind": (["999.5", "1,000.5", "-12,345.0"], [999.5, 1000.5, -12345.0]),
    "a comma behind": (["1.000,5", "2.000,5", "3.000,0"], [1000.5, 2000.5, 3000.0]),
    "several groups": (["999", "1,234,567"], [999.0, 1234567.0]),
    "an apostrophe": (["999", "1'000"], [999.0, 1000.0]),
    "a blank": (["999", "1\u00a0000,5"], [999.0, 1000.5]),
}


@pytest.mark.parametrize("name", THOUSANDS)
def test_groups_of_thousands_are_joined_where_it_is_certain(name):
    cells, numbers = THOUSANDS[name]
    table = _read(cells)
    np.testing.assert_array_equal(table.columns["x"], numbers)
    assert table.notes == ["column 'x': its groups of thousands are joined"]


def test_single_numbers_in_brackets_are_numbers(tmp_path):
    table = _read(["[-1.2e-15]", "[0.]", "[[3]]", "0", "[nan]"])
    np.testing.assert_array_equal(table.columns["x"], [-1.2e-15, 0.0, 3.0, 0.0, np.nan])
    assert table.notes == ["column 'x': single numbers in brackets are read as numbers"]
    path = tmp_path / "log.csv"
    path.write_text("t,u,y\n[s],[1],[1]\n0.0,[0.5],[1.5]\n0.1,[0.25],[2.5]\n")
    found = read_table(path)
    np.testing.assert_array_equal(found.numbers("y"), [1.5, 2.5])
    assert found.units == {"t": "[s]", "u": "[1]", "y": "[1]"}


@pytest.mark.parametrize("cell", ["[1.0, 2.0]", "[1.0 2.0]", "[on]", "(1.0)", "[]"])
def test_other_brackets_stay_as_they_are(cell):
    assert _read([cell] * 3).columns["x"] == [cell] * 3


def test_the_points_of_another_column_tell_what_a_comma_is():
    np.testing.assert_array_equal(_read(["999", "1,000"], u=np.array([0.5, 1.0])).columns["x"], [999, 1000])
    assert _read(["999", "1,000"], u=np.array([1.0, 2.0])).columns["x"] == ["999", "1,000"]
    np.testing.assert_array_equal(_read(["1.234", "5.678", "err"]).columns["x"], [1.234, 5.678, np.nan])


def test_single_texts_among_numbers_were_not_measured(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,u,y,mode\n0,1,0,on\n1,ovf,0,on\n2,NaN?,0,on\n3,,0,off\n4,5,0,on\n5,6,0,on\n")
    table = read_table(path)
    np.testing.assert_array_equal(table.numbers("u"), [1, np.nan, np.nan, np.nan, 5, 6])
    assert table.columns["mode"] == ["on", "on", "on", "off", "on", "on"]
    assert table.notes == ["column 'u': 2 cells of text ('ovf', 'NaN?'), the first in row 1, are read as not measured"]
    later = read_table(path, options={"rows": slice(1, 6)})
    assert "the first in row 1," in later.notes[0]


def test_as_many_texts_as_numbers_are_no_column_of_numbers():
    assert _read(["1", "on"]).columns["x"] == ["1", "on"]
