"""Columns of Parquet and Arrow files; damaged and old ones are one line."""

from __future__ import annotations

import sys
from decimal import Decimal

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather, parquet

from idloop.errors import InputError
from idloop.records.formats import arrow as reader
from idloop.records.recognition.table_column import numbers_of
from idloop.records.recognition.time_base import find_time_base
from idloop.records.tables.table_files import read_table

T, U = np.arange(50) * 0.01, np.sin(np.arange(50.0))


def _table():
    field = pa.field("u", pa.float64(), metadata={"unit": "V"})
    own = pa.table({"t": T, "n": pa.array([1, None] * 25), "on": pa.array([True, None] * 25), "state": ["a", "b"] * 25,
                    "kind": pa.array(["x", "y"] * 25).dictionary_encode(),
                    "when": pa.array((1_700_000_000_000_000 + 10_000 * np.arange(50)), pa.timestamp("us", tz="UTC")),
                    "price": pa.array([Decimal("1.50")] * 50), "pose": pa.array([{"x": 1.0, "y": 2.0}] * 50),
                    "pair": pa.array([[1.0, 2.0]] * 50, pa.list_(pa.float32(), 2)),
                    "many": pa.array([[1.0], [1.0, 2.0]] * 25)})  # fmt: skip
    return own.append_column(field, [U])


def _parquet(path, table):
    parquet.write_table(table, path, row_group_size=13)


def _feather(path, table):
    feather.write_feather(table, path, chunksize=13)


def _stream(path, table):
    with pa.ipc.new_stream(path, table.schema) as writer:
        writer.write_table(table, max_chunksize=13)


def _when(unit, zone):
    return pa.timestamp(unit, tz=zone)


@pytest.mark.parametrize("name", ["timestamp", "time_ms", "Time (us)"])
@pytest.mark.parametrize(
    "kind",
    [
        *(_when(unit, zone) for unit in ("ms", "us", "ns") for zone in (None, "UTC", "Europe/Berlin")),
        *map(pa.duration, ("ms", "us", "ns")),
        pa.time32("ms"),
        pa.time64("us"),
        pa.time64("ns"),
    ],
    ids=str,
)
def test_times_are_seconds_whatever_they_count(tmp_path, kind, name):
    path, begin = tmp_path / "a.parquet", 1_700_000_000 if pa.types.is_timestamp(kind) else 36_000
    milliseconds = begin * 1000 + 10 * np.arange(50)
    counted = pa.array(milliseconds * {"ms": 1, "us": 1000, "ns": 1_000_000}[kind.unit])
    counted = counted.cast(pa.int32()) if kind.bit_width == 32 else counted
    parquet.write_table(pa.table({name: counted.cast(kind), "u": U}), path)
    table = read_table(path)
    np.testing.assert_array_equal(table.numbers(name), milliseconds / 1000)
    base = find_time_base(table, numbers_of(table), None, 50, None)
    assert (base.time.column, base.time.unit, base.doubt) == (name, "s", "")


def test_a_time_that_is_missing_is_not_measured(tmp_path):
    kind = pa.timestamp("ns")
    parquet.write_table(pa.table({"t": pa.array([1_500_000_000, None], kind), "u": [1.0, 2.0]}), tmp_path / "a.parquet")
    np.testing.assert_array_equal(read_table(tmp_path / "a.parquet").numbers("t"), [1.5, np.nan])


@pytest.mark.parametrize(("write", "name"), [(_parquet, "a.parquet"), (_feather, "a.feather"), (_stream, "a.arrows")])
def test_columns(tmp_path, write, name):
    write(tmp_path / name, _table())
    table = read_table(tmp_path / name)
    np.testing.assert_array_equal(table.numbers("u"), U)
    np.testing.assert_array_equal(table.numbers("n"), [1.0, np.nan] * 25)
    np.testing.assert_array_equal(table.numbers("on"), [1.0, np.nan] * 25)
    assert table.raw("state")[:2] == ["a", "b"]
    assert table.raw("kind")[:2] == ["x", "y"]
    np.testing.assert_allclose(table.numbers("when")[:2] - 1.7e9, [0.0, 0.01], atol=1e-6)
    np.testing.assert_array_equal(table.numbers("price"), np.full(50, 1.5))
    np.testing.assert_array_equal(table.numbers("pose.y"), np.full(50, 2.0))
    np.testing.assert_array_equal(table.numbers("pair[1]"), np.full(50, 2.0))
    assert table.units == {"u": "V", "when": "s"}
    assert table.notes == ["columns that hold neither numbers nor texts are left out: many"]


@pytest.mark.parametrize(("write", "name"), [(_parquet, "a.parquet"), (_feather, "a.feather")])
def test_what_takes_too_much_is_one_line(tmp_path, monkeypatch, write, name):
    # A column of one value takes a few bytes for any number of rows.
    write(tmp_path / name, pa.table({"u": np.zeros(100_000)}))
    monkeypatch.setattr(reader, "MOST_TABLE", 80_000)
    with pytest.raises(InputError, match="its columns take more than"):
        read_table(tmp_path / name)


def test_memory_that_ends_is_one_line(tmp_path):
    def load():
        raise pa.ArrowMemoryError("malloc failed")

    (tmp_path / "a.parquet").write_bytes(b"PAR1")
    with pytest.raises(InputError, match="its values take more than"):
        reader._read(tmp_path / "a.parquet", "Parquet", load)


@pytest.mark.parametrize(("write", "name"), [(_parquet, "a.parquet"), (_feather, "a.feather"), (_stream, "a.arrows")])
def test_a_file_that_is_cut_off_is_one_line(tmp_path, write, name):
    write(tmp_path / name, _table())
    data = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=r"not a readable (Parquet|Arrow) file") as caught:
        read_table(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_feather_of_version_1_is_refused_with_the_correction(tmp_path):
    (tmp_path / "a.feather").write_bytes(b"FEA1" + bytes(100))
    with pytest.raises(InputError, match="save it again as version 2"):
        read_table(tmp_path / "a.feather")


def test_without_the_library_the_line_says_how_to_get_it(tmp_path, monkeypatch):
    (tmp_path / "a.parquet").write_bytes(b"PAR1" + bytes(100))
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"pyarrow .* is not installed; run: pip install 'idloop\[formats\]'"):
        read_table(tmp_path / "a.parquet")


def test_lists_of_one_length_become_columns(tmp_path):
    # As data sets for learning have them, written by pandas: the type of the column states no length.
    several, gap = [[1.0] * (1 + row % 2) for row in range(50)], [None, *([[1.0]] * 49)]
    state = [[0.0, one] for one in U]
    table = pa.table({"timestamp": T, "observation.state": state, "several": several, "gap": gap})
    parquet.write_table(table, tmp_path / "a.parquet")
    read = read_table(tmp_path / "a.parquet")
    assert {"observation.state[0]", "observation.state[1]"} <= set(read.columns)
    np.testing.assert_array_equal(read.numbers("observation.state[1]"), U)
    assert "several, gap" in read.notes[0]
