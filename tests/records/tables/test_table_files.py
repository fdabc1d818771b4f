"""Files of four formats become the same columns; damaged ones are refused with one line."""

from __future__ import annotations

import io
import json
import os
import tracemalloc
import zipfile

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.tables import csv_file
from idloop.records.tables.table_files import read_table

T, U = [0.0, 0.1, 0.2], [1.0, -1.0, 2.5]


def _csv(path, text):
    path.write_text(text, encoding="utf-8")
    return path


CSV = {
    "comma": "t,u\n0,1\n0.1,-1\n0.2,2.5\n",
    "trailing comma, quotes": '"t","u",\n0,1,\n0.1,-1,\n0.2,2.5,\n',
    "tab": "t\tu\n0\t1\n0.1\t-1\n0.2\t2.5\n",
    "blanks": "t   u\n0   1\n0.1  -1\n0.2 2.5\n",
    "a tabulator beside one comma": "t,u,\tv\n0,1,\t0\n0.1,-1,\t0\n0.2,2.5,\t0\n",
    "comments and empty lines": "# made by hand\n\nt;u\n0;1\n0.1;-1\n\n0.2;2.5\n",
    "names in the comment above": "# made by hand\n# t,u\n0,1\n0.1,-1\n0.2,2.5\n",
    "names in the comment above, blanks": "# t u\n0 1\n0.1 -1\n0.2 2.5\n",
    "byte order mark": "\ufefft,u\n0,1\n0.1,-1\n0.2,2.5\n",
}


@pytest.mark.parametrize("name", CSV)
def test_csv_dialects(tmp_path, name):
    table = read_table(_csv(tmp_path / "a.csv", CSV[name]))
    assert list(table.columns)[:2] == ["t", "u"]
    assert table.notes == []
    np.testing.assert_array_equal(table.numbers("t"), T)
    np.testing.assert_array_equal(table.numbers("u"), U)


def test_csv_without_header_and_with_decimal_commas(tmp_path):
    table = read_table(_csv(tmp_path / "a.csv", "0;1\n0,1;-1\n0,2;2,5\n"), options={"decimal": ","})
    np.testing.assert_array_equal(table.numbers(0), T)
    np.testing.assert_array_equal(table.numbers("1"), U)


COMMAS = {
    "semicolons": "t;u\n0,0;1\n0,1;-1,0\n0,2;2,5\n",
    "semicolons without a header": "0,0;1,0\n0,1;-1,0\n0,2;2,5\n",
    "tabulators": "t\tu\n0,0\t1\n0,1\t-1\n0,2\t2,5\n",
    "blanks": "t    u\n0,0  1\n0,1 -1\n0,2  2,5\n",
    "quotes": 't,u\n"0,0","1"\n"0,1","-1"\n"0,2","2,5"\n',
    "exponents": "t;u\n0;1,0E+00\n1,0e-01;-1,0E0\n2,0E-1;2,5E0\n",
    "three digits": "t;u\n0,000;1,000\n0,100;-1,000\n0,200;2,500\n",
    "a row of units": "t;u\n[s];[V]\n0,0;1\n0,1;-1\n0,2;2,5\n",
}


@pytest.mark.parametrize("name", COMMAS)
def test_decimal_commas_are_found_out_and_told(tmp_path, name):
    table = read_table(_csv(tmp_path / "a.csv", COMMAS[name]))
    np.testing.assert_array_equal(table.numbers(0), T)
    np.testing.assert_array_equal(table.numbers(1), U)
    assert "its numbers are read with decimal commas" in table.notes


def test_what_may_be_thousands_is_asked_and_not_guessed(tmp_path):
    path = _csv(tmp_path / "a.csv", "t;u\n0;1,234\n1;2,345\n")
    with pytest.raises(
        InputError, match=r"'1,234' may be a decimal number or a thousand; set `csv: \{decimal: \",\"\}`"
    ):
        read_table(path)
    np.testing.assert_array_equal(read_table(path, options={"decimal": ","}).numbers("u"), [1.234, 2.345])


def test_a_comma_beside_points_is_no_decimal_comma(tmp_path):
    table = read_table(_csv(tmp_path / "a.csv", "t;u;state\n0.5;1;a,b\n1.5;2;0,5\n"))
    assert table.notes == []
    np.testing.assert_array_equal(table.numbers("t"), [0.5, 1.5])
    with pytest.raises(InputError, match="if it has a decimal comma"):
        table.numbers("state")


@pytest.mark.parametrize("block", [1, 3, 1 << 24])
@pytest.mark.parametrize("encoding", ("latin-1", "cp1252", "utf-8", "utf-16"))
def test_letters_of_other_encodings(tmp_path, monkeypatch, encoding, block):
    monkeypatch.setattr(csv_file, "_BLOCK", block)
    path = tmp_path / "a.csv"
    path.write_bytes("t [µs];Winkel [°]\r\n0,0;1\r\n0,1;-1\r\n0,2;2,5\r\n".encode(encoding))
    table = read_table(path)
    assert list(table.columns) == ["t [µs]", "Winkel [°]"]
    np.testing.assert_array_equal(table.numbers("Winkel [°]"), U)
    other = encoding in {"latin-1", "cp1252"}
    assert ("it is not in UTF-8 and read as Windows-1252" in table.notes) is other


@pytest.mark.parametrize("block", [1, 3, 1 << 24])
def test_what_is_no_letter_is_named_by_its_place(tmp_path, monkeypatch, block):
    monkeypatch.setattr(csv_file, "_BLOCK", block)
    (tmp_path / "a.csv").write_bytes("t,µ\n0,1\n".encode() + b"\x00\xff")
    with pytest.raises(InputError, match=r"not a text file \(invalid start byte at byte 10\)"):
        read_table(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_bytes("t,µ\n0,1\n".encode("utf-16") + b"\x00")
    with pytest.raises(InputError, match=r"not a text file \(invalid start byte at byte 0\)"):
        read_table(tmp_path / "a.csv")


UNITS = {
    "in brackets": "t,u,w\n[s],[V],[rad/s]\n0,1,2\n0.1,-1,3\n",
    "plain": "t,u,w\ns,V,rad/s\n0,1,2\n0.1,-1,3\n",
    "one is missing": "t,u,w\ns,,rad/s\n0,1,2\n0.1,-1,3\n",
    "with types above": "t,u,w\nREAL,INT,REAL\ns,V,rad/s\n0,1,2\n0.1,-1,3\n",
}


@pytest.mark.parametrize("name", UNITS)
def test_a_row_of_units_below_the_header_is_left_out_and_told(tmp_path, name):
    table = read_table(_csv(tmp_path / "a.csv", UNITS[name]))
    for column, values in (("t", [0.0, 0.1]), ("u", [1.0, -1.0]), ("w", [2.0, 3.0])):
        np.testing.assert_array_equal(table.numbers(column), values)
    (note,) = table.notes
    assert note.startswith("the row below the header is read as units and left out: ")


def test_a_first_row_with_a_number_is_data(tmp_path):
    table = read_table(_csv(tmp_path / "a.csv", "t,u\n0,off\n0.1,3\n"))
    assert table.notes == []
    with pytest.raises(InputError, match="row 0 of column 'u' is 'off'"):
        table.numbers("u")
    # Columns of words alone have no units above them.
    assert len(read_table(_csv(tmp_path / "b.csv", "a,b\nx,y\nz,w\n")).columns["a"]) == 2


def test_empty_cells_are_not_measured(tmp_path):
    table = read_table(_csv(tmp_path / "a.csv", "t,u\n0,\n0.1,3\n"))
    np.testing.assert_array_equal(table.numbers("u"), [np.nan, 3.0])


def test_the_entries_of_structure_and_cell_arrays_are_columns_of_their_own(tmp_path):
    from scipy.io import savemat

    runs = np.array([(np.arange(3.0), np.ones(3), 100.0), (np.arange(4.0), np.zeros(4), 200.0)],
                    dtype=[("t", "O"), ("u", "O"), ("rate", "O")])  # fmt: skip
    cells = np.empty(2, dtype=object)
    cells[:] = [np.arange(3.0), np.arange(5.0)]
    savemat(tmp_path / "a.mat", {"runs": runs, "logs": cells, "grid": np.ones((3, 2))})
    (tmp_path / "a.json").write_text(json.dumps({
        "runs": [{"t": [0, 1, 2], "u": [1, 1, 1], "rate": 100}, {"t": [0, 1, 2, 3], "u": [0, 0, 0, 0], "rate": 200}],
        "logs": [[0, 1, 2], [0, 1, 2, 3, 4]], "grid": [[1, 1], [1, 1], [1, 1]],
    }))  # fmt: skip
    for name in ("a.mat", "a.json"):
        table = read_table(tmp_path / name)
        assert set(table.columns) == {
            "runs[0].t", "runs[0].u", "runs[1].t", "runs[1].u", "logs[0]", "logs[1]", "grid[0]", "grid[1]"
        }  # fmt: skip
        assert table.attributes["runs[1].rate"] == 200.0
        assert [len(table.columns[c]) for c in ("runs[1].t", "logs[1]", "grid[1]")] == [4, 5, 3]


def test_what_is_no_series_in_a_list_is_left_alone(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps({"u": [1, 2], "odd": [[[1], [1, 2]], [3]], "mixed": [[1], {"a": 2}]}))
    assert set(read_table(tmp_path / "a.json").columns) == {"u"}


def test_mat_npz_and_json_agree(tmp_path):
    from scipy.io import savemat

    savemat(
        tmp_path / "a.mat", {"data": {"t": np.array(T)[:, None], "u": np.array(U)}, "gain": 3.5, "two": np.ones((3, 2))}
    )
    np.savez(tmp_path / "a.npz", t=T, u=U, gain=3.5)
    (tmp_path / "a.json").write_text(
        json.dumps({"gain": 3.5, "rows": [{"t": t, "u": u} for t, u in zip(T, U, strict=True)]})
    )
    (tmp_path / "b.json").write_text(json.dumps({"t": T, "u": U, "gain": 3.5}))
    for name, prefix, options in (
        ("a.mat", "data.", {}),
        ("a.npz", "", {}),
        ("a.json", "", {"entries": "rows"}),
        ("b.json", "", {}),
    ):
        table = read_table(tmp_path / name, options=options)
        np.testing.assert_array_equal(table.numbers(prefix + "t"), T)
        np.testing.assert_array_equal(table.numbers(prefix + "u"), U)
        assert table.attributes["gain"] == 3.5
    assert {"two[0]", "two[1]"} <= set(read_table(tmp_path / "a.mat").columns)


BAD = {
    "cell that is no number": ("a.csv", b"t,u\n0,1\n0.1,one\n", "row 1 of column 'u' is 'one'"),
    "header only": ("a.csv", b"t,u\n", "there are no rows of data"),
    "arrays of no length": ("a.json", b'{"t": [], "u": []}', "there are no rows of data"),
    "row cut off": ("a.csv", b"t,u\n0,1\n0.1", "row 1 has 1 cells instead of 2"),
    "row too long": ("a.csv", b"t,u\n0,1\n0,1,2,5\n", "row 1 has 4 cells instead of 2; save it with ; between"),
    "no rows": ("a.csv", b"\n\n", "no rows"),
    "nothing": ("a.csv", b"", "the file is empty (0 bytes)"),
    "empty lists": ("a.csv", b"()\n()\n", "known: ()"),
    "not text": ("a.csv", b"\xff\xfe\x00,\x91\n", "not a text file"),
    "damaged MAT": ("a.mat", b"MATLAB 5.0 rubbish" * 20, "not a readable MAT file"),
    "damaged NPZ": ("a.npz", b"PK\x03\x04rubbish", "not a readable NPZ file"),
    "damaged JSON": ("a.json", b'{"a": [1, 2', "not valid JSON"),
    "JSON without samples": ("a.json", b"3", "neither a list of samples"),
    "unknown format": ("a.xlsx", b"PK", "unknown format '.xlsx'"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files(tmp_path, name):
    file, content, words = BAD[name]
    (tmp_path / file).write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_table(tmp_path / file).numbers("u")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_misspelt_names(tmp_path):
    path = _csv(tmp_path / "data.csv", "time,speed\n0,1\n")
    with pytest.raises(InputError, match=r"did you mean 'data\.csv'"):
        read_table(tmp_path / "date.csv")
    with pytest.raises(InputError, match="did you mean 'speed'"):
        read_table(path).numbers("sped")
    with pytest.raises(InputError, match="no column 5"):
        read_table(path).numbers(5)


@pytest.mark.parametrize("stretch", [1, 4, 500_000])
def test_a_table_is_the_same_in_however_many_stretches_it_is_read(tmp_path, monkeypatch, stretch):
    monkeypatch.setattr(csv_file, "_CELLS", stretch)
    rows = [f"2024-01-{day:02};{day};{day},5;;{'' if day % 3 else day}" for day in range(1, 29)]
    table = read_table(_csv(tmp_path / "a.csv", "when;n;x;none;some\n" + "\n".join(rows)))
    assert table.raw("when") == [row.partition(";")[0] for row in rows]
    np.testing.assert_array_equal(table.numbers("n"), np.arange(1.0, 29.0))
    np.testing.assert_array_equal(table.numbers("x"), np.arange(1.5, 29.5))
    assert np.isnan(table.numbers("none")).all()
    np.testing.assert_array_equal(np.flatnonzero(~np.isnan(table.numbers("some"))) % 3, 2)
    with pytest.raises(InputError, match="row 0 of column 'when' is '2024-01-01'"):
        table.numbers("when")


@pytest.mark.parametrize("stretch", [1, 4, 500_000])
def test_the_first_row_of_another_width_is_named(tmp_path, monkeypatch, stretch):
    monkeypatch.setattr(csv_file, "_CELLS", stretch)
    with pytest.raises(InputError, match="row 27 has 1 cells instead of 2"):
        read_table(_csv(tmp_path / "a.csv", "t,u\n" + "0,1\n" * 27 + "0\n0,1\n0,1,2\n"))
    with pytest.raises(InputError, match="row 27 has 3 cells instead of 2"):
        read_table(_csv(tmp_path / "a.csv", "t,u\n" + "0,1\n" * 27 + "0,1,2\n0,1\n0\n"))


@pytest.mark.slow
def test_a_long_log_takes_eight_bytes_for_a_number(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_file, "_CELLS", 20_000)
    path = _csv(tmp_path / "a.csv", "t,u,n\n" + "0.125,-1.5,7\n" * 200_000)
    tracemalloc.start()
    try:
        table = read_table(path)
        kept, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert kept < 1.1 * 8 * 3 * 200_000 + 500_000
    # The texts of one stretch beside it, and the file that is looked at; the texts of the whole table would take 40 MB.
    assert most < 25_000_000
    assert table.numbers("u").sum() == -300_000.0


def test_a_table_that_takes_more_than_the_limit_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_file, "MOST_TABLE", 8 * 2 * 10)
    monkeypatch.setattr(csv_file, "_CELLS", 2)
    assert len(read_table(_csv(tmp_path / "a.csv", "t,u\n" + "0,1\n" * 10)).columns["u"]) == 10
    with pytest.raises(InputError, match="11 rows of its 2 columns take more than"):
        read_table(_csv(tmp_path / "a.csv", "t,u\n" + "0,1\n" * 11))


def _array_of_nothing(length):
    """An archive of one array whose elements have no size."""
    header, file = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<U0", "fortran_order": False, "shape": (length,)})
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("u.npy", header.getvalue())
    return file.getvalue()


LONG = {
    "a cell": ("a.csv", b"t,u\n0,1\n0," + b"1" * 200_000 + b"\n", "field larger than field limit"),
    "columns": ("a.csv", b"," * 20_000 + b"\n" + b"1," * 20_000, "20,001 columns, more than 10,000"),
    "digits in JSON": ("a.json", b'{"t": [1, ' + b"9" * 5_000 + b"]}", "more than 250 digits"),
    "an array of nothing": ("a.npz", _array_of_nothing(10**12), "take more than 2 GiB"),
    "structures": ("a.json", b'{"t": ' + b'{"t": ' * 500 + b"1" + b"}" * 501, "more than 64 deep"),
}


@pytest.mark.parametrize("name", LONG)
def test_what_is_longer_than_any_table_is_one_line(tmp_path, name):
    file, content, words = LONG[name]
    (tmp_path / file).write_bytes(content)
    with pytest.raises(InputError, match=words) as caught:
        read_table(tmp_path / file)
    assert "\n" not in str(caught.value)


def test_columns_of_one_name_are_told_apart_by_their_places(tmp_path):
    table = read_table(_csv(tmp_path / "a.csv", "t,value,value\n0,1 V,2 rad\n1,3 V,4 rad\n"))
    assert list(table.columns) == ["t", "value.1", "value.2"]
    assert table.units == {"value.1": "V", "value.2": "rad"}
    assert "columns of one name (value) have their places behind it, counted from 0" in table.notes
    np.testing.assert_array_equal(table.columns["value.2"], [2, 4])
    with pytest.raises(InputError, match=r"no column 'value'; known: t, value.1, value.2"):
        table.numbers("value")


def test_two_columns_of_one_name_among_ten_thousand_are_found_at_once(tmp_path):
    names = [f"c{k}" for k in range(9_999)]
    table = read_table(_csv(tmp_path / "a.csv", ",".join([*names, "c9998"]) + "\n" + "1," * 9_999 + "1\n"))
    assert list(table.columns)[-2:] == ["c9998.9998", "c9998.9999"]


def test_what_is_no_regular_file_is_named(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="pipe: no regular file"):
        read_table(tmp_path / "pipe")
    with pytest.raises(InputError, match="a directory; name the file"):
        read_table(tmp_path)
