"""Pages read one by one give what SQLite itself reads, and of a cut or spoilt file nothing that was not in it."""

from __future__ import annotations

import sqlite3
from contextlib import closing

import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.records.bags.storage.sqlite_pages import SqlitePages

VALUES = st.one_of(
    st.none(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False),
    st.text(max_size=20),
    st.binary(max_size=3000),
)
ROWS = st.lists(st.tuples(VALUES, VALUES, VALUES), max_size=60)
SIZES = st.sampled_from([512, 1024, 4096, 65536])


def file_of(tmp_path_factory, rows, size):
    path = tmp_path_factory.mktemp("pages") / "rows.db3"
    with closing(sqlite3.connect(path)) as base:
        base.execute(f"PRAGMA page_size = {size}")
        base.execute("CREATE TABLE other (id INTEGER PRIMARY KEY, name TEXT)")
        base.execute("CREATE TABLE mixed(a, b ,c)")
        base.executemany("INSERT INTO mixed VALUES (?, ?, ?)", rows)
        base.commit()
    return path.read_bytes()


def read(data):
    pages = SqlitePages(data)
    found = pages.table("mixed")
    return [tuple(values) for _, values in pages.rows(found[0])] if found else []


@given(rows=ROWS, size=SIZES)
def test_a_whole_table_is_read_as_sqlite_reads_it(tmp_path_factory, rows, size):
    data = file_of(tmp_path_factory, rows, size)
    assert SqlitePages(data).whole
    assert SqlitePages(data).table("mixed")[1] == ["a", "b", "c"]
    assert SqlitePages(data).table("nobody") is None
    assert read(data) == rows


@given(rows=ROWS, size=SIZES, part=st.floats(0.0, 0.999))
def test_of_a_cut_file_only_whole_rows_are_read(tmp_path_factory, rows, size, part):
    data = file_of(tmp_path_factory, rows, size)
    cut = data[: int(part * len(data))]
    if len(cut) < 100:
        with pytest.raises(ValueError, match="not the beginning"):
            SqlitePages(cut)
        return
    pages = SqlitePages(cut)
    assert not pages.whole
    known = set(map(repr, rows)) | set(map(repr, ((None, "x"),)))
    leaves = [tuple(values) for number in pages.leaves() for _, values in pages.leaf(number) if len(values) == 3]
    assert set(map(repr, leaves)) <= known
    assert set(map(repr, read(cut))) <= known


@given(rows=ROWS, where=st.integers(0, 10**6), bytes_=st.binary(min_size=1, max_size=40))
def test_a_spoilt_file_ends_and_does_not_raise(tmp_path_factory, rows, where, bytes_):
    data = bytearray(file_of(tmp_path_factory, rows, 512))
    at = 100 + where % (len(data) - 100)
    data[at : at + len(bytes_)] = bytes_[: len(data) - at]
    pages = SqlitePages(bytes(data))
    read(bytes(data))
    for number in pages.leaves():
        list(pages.leaf(number))
