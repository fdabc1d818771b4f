"""A file is recognised by what is in it, then by its suffix."""

from __future__ import annotations

import gzip
import pickle
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.formats.registry import form_of, kinds, table_of_forms
from idloop.records.tables.mapping import Mapping
from idloop.records.tables.table_files import read_table


def _form(tmp_path, name, content):
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return form_of(tmp_path / name).kind


def test_a_mapping_may_name_each_form():
    (named,) = (one for one in get_args(Mapping.model_fields["format"].annotation) if one is not type(None))
    assert set(get_args(named)) == {*kinds(), "bag"}


def test_the_page_lists_each_form():
    # To renew it: python -c "from idloop.records.formats.registry import table_of_forms; print(table_of_forms())"
    page = Path(__file__).parents[3] / "docs" / "reference" / "mapping-file.md"
    assert table_of_forms() in page.read_text(encoding="utf-8")


def test_the_content_says_more_than_the_suffix(tmp_path):
    np.savez(tmp_path / "a.npz", u=np.arange(3.0))
    assert _form(tmp_path, "log.csv", (tmp_path / "a.npz").read_bytes()) == "npz"
    assert _form(tmp_path, "log.dat", '{"t": [0, 1]}') == "json"
    assert _form(tmp_path, "log", "t u\n0 1\n1 2\n") == "csv"
    assert _form(tmp_path, "log.json", "broken") == "json"
    assert _form(tmp_path, "log.csv", "[s],[V]\n0,1\n") == "csv"
    assert _form(tmp_path, "log.log", "start\n0,1\n1,2\n") == "csv"


def test_a_form_that_is_named_is_taken(tmp_path):
    (tmp_path / "log.txt").write_text('{"t": [0, 1], "u": [1, 2]}')
    np.testing.assert_array_equal(read_table(tmp_path / "log.txt", "json").numbers("u"), [1, 2])
    with pytest.raises(InputError, match=r"unknown format 'josn'; .*did you mean 'json'"):
        read_table(tmp_path / "log.txt", "josn")


OTHERS = {
    "a workbook": ("a.xlsx", b"PK\x03\x04" + b"[Content_Types].xml xl/workbook.xml", "save its sheet as CSV"),
    "an archive": ("a.csv.gz", gzip.compress(b"t,u\n"), "unpack it with gunzip"),
    "a database": ("a.db", b"SQLite format 3\0", "SQLite"),
    "a program": ("a.bin", b"\x7fELF\x00\x01", "unknown format '.bin'; known are .csv, .txt"),
    "a text": ("a.md", b"# Title\n\nNo numbers here.\n", "unknown format '.md'"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_files_are_one_line(tmp_path, name):
    file, content, words = OTHERS[name]
    (tmp_path / file).write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_table(tmp_path / file)


@pytest.mark.parametrize(
    "text",
    [
        "(1436509052.249713) vcan0 044#2A366C2BBA\n",
        "  vcan0  201   [2]  2A 36\n",
        "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2\n166064000,0000021A,false,Rx,0,2,FE,36\n",
    ],
)
def test_raw_frames_of_a_bus_are_refused_with_what_to_do(tmp_path, text):
    (tmp_path / "can.log").write_text(text * 3)
    with pytest.raises(InputError, match="raw frames of a CAN bus; export the signals"):
        form_of(tmp_path / "can.log")


@pytest.mark.parametrize(
    ("head", "advice"),
    [(b"MDF     4.10    ", "asammdf"), (b"TDSm\x0e\0\0\0", "nptdms"), (b"ULog\x01\x12\x35\x01", "ulog2csv")],
)
def test_recordings_of_other_tools_are_refused_with_what_to_do(tmp_path, head, advice):
    (tmp_path / "log.bin").write_bytes(head + bytes(100))
    with pytest.raises(InputError, match=advice):
        form_of(tmp_path / "log.bin")


@pytest.mark.parametrize("protocol", range(2, 6))
def test_a_pickle_is_named_with_the_way_out(tmp_path, protocol):
    with pytest.raises(InputError, match=r"a pickle of Python.* numpy\.savez"):
        _form(tmp_path, "log.pkl", pickle.dumps({"t": [0.0, 1.0]}, protocol=protocol))


@pytest.mark.parametrize("name", ["a.mat", "a.parquet", "a.h5", "a.npz", "a.pt"])
def test_a_table_of_text_under_another_suffix_is_read_as_one(tmp_path, name):
    assert _form(tmp_path, name, "  0.0e+00   1.0e+00\n  1.0e-02   1.5e+00\n  2.0e-02   1.7e+00\n") == "csv"


@pytest.mark.parametrize("name", ["a.csv", "a.mat", "a.parquet", "a.h5", "a.npz", "a.json"])
def test_an_empty_file_is_called_empty(tmp_path, name):
    (tmp_path / name).touch()
    with pytest.raises(InputError, match=r"the file is empty \(0 bytes\)"):
        read_table(tmp_path / name)
