"""LabVIEW measurement files: the head says delimiter and decimal sign, and the table lies below it."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.tables.table_files import read_table

HEAD = (
    "LabVIEW Measurement{0}\nReader_Version{0}2\nSeparator{0}{1}\nDecimal_Separator{0}{2}\n***End_of_Header***{0}\n\n"
)
TABLE = "Channels{0}2\nX_Dimension{0}Time{0}Time\nX0{0}0{0}0\nDelta_X{0}0.1{0}0.1\n***End_of_Header***{0}{0}\n"
ROWS = "X_Value{0}u{0}q{0}Comment\n0.0{0}1.5{0}2\n0.1{0}-1.5{0}3\n0.2{0}0.5{0}4\n"


@pytest.mark.parametrize(
    ("delimiter", "word", "decimal"), [("\t", "Tab", "."), ("\t", "Tab", ","), (",", "Comma", ".")]
)
def test_delimiters_and_decimal_signs(tmp_path, delimiter, word, decimal):
    table = (TABLE + ROWS).format(delimiter).replace(".", decimal)
    (tmp_path / "a.lvm").write_text(HEAD.format(delimiter, word, decimal) + table)
    found = read_table(tmp_path / "a.lvm")
    np.testing.assert_array_equal(found.numbers("X_Value"), [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(found.numbers("u"), [1.5, -1.5, 0.5])
    assert found.clocks == {"u": "X_Value", "q": "X_Value"}
    assert found.units == {"X_Value": "s"}


def test_units_of_the_channels(tmp_path):
    table = TABLE.replace("X_Dimension", "Y_Unit_Label{0}Volts{0}deg\nX_Dimension") + ROWS
    (tmp_path / "a.lvm").write_text((HEAD + table).format("\t", "Tab", "."))
    assert read_table(tmp_path / "a.lvm").units == {"X_Value": "s", "u": "Volts", "q": "deg"}


BAD = {
    "no table": (HEAD.format("\t", "Tab", "."), "no table below its head"),
    "several segments": ((HEAD + TABLE + ROWS + TABLE + ROWS).format("\t", "Tab", "."), "it holds 2 segments"),
    "no end of the head": ("LabVIEW Measurement\n" + "a\tb\n" * 2000, "in its first 1,000 lines"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files(tmp_path, name):
    text, words = BAD[name]
    (tmp_path / "a.lvm").write_text(text)
    with pytest.raises(InputError, match=words):
        read_table(tmp_path / "a.lvm")
