"""A damaged file of any form is a table or one line, whatever bytes are changed, cut or inserted."""

from __future__ import annotations

import warnings

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.records.formats.seeds import seeds

from idloop.errors import InputError
from idloop.records.formats.registry import form_of, kinds
from idloop.records.tables.table import Table
from idloop.records.tables.table_files import read_table

CHANGES = st.lists(
    st.tuples(
        st.floats(0.0, 1.0),
        st.sampled_from(("flip", "cut", "insert", "set", "end")),
        st.integers(0, 255),
        st.sampled_from((1, 4, 8, 64)),
    ),
    min_size=1,
    max_size=6,
)


def test_every_form_is_damaged():
    assert set(seeds()) == set(kinds())


@pytest.mark.parametrize("kind", kinds())
def test_valid_files_are_recognised_and_read(tmp_path, kind):
    suffix, files = seeds()[kind]
    for place, content in enumerate(files):
        path = tmp_path / f"{place}{suffix}"
        path.write_bytes(content)
        assert form_of(path).kind == kind
        assert any(len(column) == 40 for column in read_table(path).columns.values()) or kind == "sysid"


def _check_line(line, path):
    assert line.startswith(str(path))
    assert "\n" not in line


def _check_table(table):
    assert isinstance(table, Table)
    for name, clock in table.clocks.items():
        assert len(table.columns[name]) == len(table.columns[clock])


@pytest.mark.parametrize("kind", kinds())
@given(changes=CHANGES, place=st.integers(0, 7))
@settings(max_examples=25)
def test_damaged_files(tmp_path_factory, kind, changes, place):
    suffix, files = seeds()[kind]
    data = bytearray(files[place % len(files)])
    for where, change, value, length in changes:
        at = min(int(where * len(data)), len(data) - 1)
        if not data or at < 0:
            break
        if change == "flip":
            data[at] ^= 1 << (value % 8)
        elif change == "set":
            data[at : at + length] = bytes([value]) * min(length, len(data) - at)
        elif change == "cut":
            del data[at : at + length]
        elif change == "insert":
            data[at:at] = bytes([value]) * length
        else:
            del data[at:]
    path = tmp_path_factory.mktemp(kind) / f"damaged{suffix}"
    path.write_bytes(data)
    for named in (None, kind):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                table = read_table(path, named)
            except InputError as error:
                _check_line(str(error), path)
            else:
                _check_table(table)
