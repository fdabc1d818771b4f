"""Exports of TwinCAT Scope: pairs of stamps and values below pairs of keys."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.formats.registry import form_of
from idloop.records.tables.table_files import read_table

HEAD = (
    "Name;Bench\nStarttime of export;133538112000000000;Monday\n\nName;Axis.Torque;Name;Axis.Pos\n"
    "NetID;5.1.1.1;NetID;5.1.1.1\nSampleTime[ms];2;SampleTime[ms];4\nUnit;Nm;Unit;deg\n"
)
ROWS = "0;1.5;0;10\n2;1.25;4;11\n4;1;8;12\n6;0.5;;\n"


@pytest.mark.parametrize(("delimiter", "decimal"), [(";", "."), (";", ","), ("\t", "."), (",", ".")])
def test_channels_with_their_stamps_and_units(tmp_path, delimiter, decimal):
    path = tmp_path / "scope.csv"
    path.write_text(HEAD.replace(";", delimiter) + ROWS.replace(".", decimal).replace(";", delimiter))
    assert form_of(path).kind == "twincat"
    table = read_table(path)
    assert table.clocks == {"Axis.Torque": "Axis.Torque.time", "Axis.Pos": "Axis.Pos.time"}
    np.testing.assert_array_equal(table.numbers("Axis.Torque"), [1.5, 1.25, 1.0, 0.5])
    np.testing.assert_array_equal(table.numbers("Axis.Pos.time"), [0.0, 4.0, 8.0])
    np.testing.assert_array_equal(table.numbers("Axis.Pos"), [10.0, 11.0, 12.0])
    assert table.units == {"Axis.Torque.time": "ms", "Axis.Pos.time": "ms", "Axis.Torque": "Nm", "Axis.Pos": "deg"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD.replace("Axis.Pos", "Axis.Torque") + ROWS, "not a pair for each"),
        (HEAD + ROWS.replace("0;1.5;0;10", "0;1.5;0;10;0;1"), "not a pair for each|cells instead of"),
        ("t;u\n0;1\n1;2\n", "no pairs of Name"),
    ],
)
def test_bad_files(tmp_path, text, words):
    (tmp_path / "scope.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        read_table(tmp_path / "scope.csv", "twincat")
