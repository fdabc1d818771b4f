"""Text files with one block for each signal are recognised, and others are not."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.formats.registry import form_of
from idloop.records.tables.table_files import read_table

ROWS = "0.0,1\n0.1,2\n0.2,3\n0.3,4\n"
TWO = {
    "titles": f"voltage\n{ROWS}\nposition\n{ROWS}",
    "titles and headers": f"voltage\ntime,value\n{ROWS}position\ntime,value\n{ROWS}",
    "comments": f"# voltage\n{ROWS}\n\n# position\n{ROWS}",
    "blanks": f'"voltage"\n{ROWS}"position"\n{ROWS}'.replace(",", " "),
    "decimal commas": f"[voltage]\n{ROWS}[position]\n{ROWS}".replace(",", ";").replace(".", ","),
}


@pytest.mark.parametrize("name", TWO)
def test_blocks(tmp_path, name):
    (tmp_path / "log.txt").write_text(TWO[name])
    table = read_table(tmp_path / "log.txt")
    assert table.clocks == {"voltage": "voltage.time", "position": "position.time"}
    np.testing.assert_array_equal(table.numbers("position"), [1.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(table.numbers("position.time"), [0.0, 0.1, 0.2, 0.3])


def test_the_unit_of_the_stamps_from_a_header(tmp_path):
    (tmp_path / "log.txt").write_text(f"voltage\ntime_ms,value\n{ROWS}position\ntime_ms,value\n{ROWS}")
    assert read_table(tmp_path / "log.txt").units == {"voltage.time": "ms", "position.time": "ms"}


OTHERS = {
    "a table": f"t,u\n{ROWS}",
    "text between rows of one table": "t,u\n0.0,1\n0.1,2\n0.2,3\nstall\n0.3,4\n0.4,5\n0.5,6\n",
    "runs under one header": f"t,u\n{ROWS}t,u\n{ROWS}",
    "three columns": "a\n0,1,2\n1,1,2\n2,1,2\nb\n0,1,2\n1,1,2\n2,1,2\n",
    "names of one run": f"run 1\n{ROWS}".replace("\n", "\nrun 1\n"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_files_are_tables(tmp_path, name):
    (tmp_path / "log.txt").write_text(OTHERS[name])
    assert form_of(tmp_path / "log.txt").kind == "csv"


BAD = {
    "no title": (f"a\n{ROWS}", ROWS.replace("0.0", "x\n0.0", 0) + f"t,u\n{ROWS}", "has no title|the title of another"),
    "a title twice": (f"a\n{ROWS}", f"a\n{ROWS}", "the title of another"),
    "another width": (f"a\n{ROWS}", "b\n0,1,2\n", "rows of other than a stamp and a value"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_blocks(tmp_path, name):
    first, second, words = BAD[name]
    (tmp_path / "log.txt").write_text(first + second)
    with pytest.raises(InputError, match=words):
        read_table(tmp_path / "log.txt", "blocks")


def test_blocks_of_many_rows_are_recognised(tmp_path):
    rows = "".join(f"{2 * k},{0.001 * k:.3f}\n" for k in range(8000))
    (tmp_path / "log.txt").write_text(f"voltage\n{rows}position\n{rows}")
    assert form_of(tmp_path / "log.txt").kind == "blocks"
    (tmp_path / "one.txt").write_text(f"voltage\n{rows}")
    (tmp_path / "runs.txt").write_text(f"t,u\n{rows}t,u\n{rows}")
    assert [form_of(tmp_path / name).kind for name in ("one.txt", "runs.txt")] == ["csv", "csv"]
