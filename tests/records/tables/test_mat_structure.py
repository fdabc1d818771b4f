"""MAT files whose tags lie are refused before the compiled reader believes them."""

from __future__ import annotations

import io
import struct
import tracemalloc
import zlib

import numpy as np
import pytest
from scipy.io import savemat

from idloop.errors import InputError
from idloop.records.tables import mat_structure
from idloop.records.tables.mat_structure import mat_damage
from idloop.records.tables.table_files import read_table


def written(content, **options):
    file = io.BytesIO()
    savemat(file, content, **options)
    return file.getvalue()


def nested(depth):
    cell = np.array([1.0])
    for _ in range(depth):
        box = np.empty(1, dtype=object)
        box[0] = cell
        cell = box
    return {"deep": cell}


WHOLE = {
    "numbers": {"x": np.arange(6.0).reshape(2, 3), "n": np.int16(3), "z": np.array([1 + 2j]), "b": np.array([True])},
    "texts": {"name": "motor", "empty": "", "rows": np.array(["one", "two"])},
    "structure": {"log": {"t": np.arange(5.0), "inner": {"gain": 2.0, "none": np.array([])}}},
    "cells": {"parts": np.array([np.arange(3.0), "text", {"a": 1.0}], dtype=object)},
    "nothing": {},
}


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("name", WHOLE)
def test_what_scipy_writes_is_whole(name, packed):
    assert mat_damage(written(WHOLE[name], do_compression=packed)) == ""


def test_version_4_has_no_tags():
    assert mat_damage(written({"t": np.arange(40.0)}, format="4")) == ""


def test_sparse_matrices_are_whole():
    from scipy.sparse import csc_array

    assert mat_damage(written({"s": csc_array(np.eye(3))})) == ""


def test_version_7_3_is_left_to_its_own_message():
    assert mat_damage(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(64)) == ""


def damaged(data, tag, new):
    """The data with the first tag of a kind replaced."""
    assert tag in data
    return data.replace(tag, new, 1)


NUMBERS = written({"t": np.arange(40.0)})
TAG = struct.pack("<II", 9, 320)  # 40 numbers of eight bytes


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (damaged(NUMBERS, TAG, struct.pack("<II", 0x89, 320)), "unknown type 137"),
        (damaged(NUMBERS, TAG, struct.pack("<II", 14, 320)), "values of another type"),
        (damaged(NUMBERS, TAG, struct.pack("<II", 9, 328)), "328 bytes where 320 are left"),
        (NUMBERS[:-3], "bytes where"),
        (NUMBERS[:132], "a tag is cut off"),
        (NUMBERS[:100], "ends within its header"),
        (NUMBERS[:128] + struct.pack("<II", 5, 0), "type 5 where a variable is due"),
        (NUMBERS[:128] + struct.pack("<II", 14, 0), "without its flags"),
        (NUMBERS[:128] + struct.pack("<IIII", 15, 8, 1, 2), "compressed data damaged"),
        (written(nested(150)), "more than 100 deep"),
    ],
    # the data hold the time at which they were written
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_tags_that_lie_are_refused_in_one_line(tmp_path, data, said):
    assert said in mat_damage(data)
    path = tmp_path / "run.mat"
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"not a readable MAT file") as refused:
        read_table(path)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_structure_with_fewer_values_than_names_is_refused():
    data = written({"log": {"t": np.arange(3.0), "u": np.arange(3.0)}})
    flags = struct.pack("<IIII", 6, 8, 2, 0)
    assert "another number" in mat_damage(data.replace(flags + struct.pack("<IIii", 5, 8, 1, 1),
                                                       flags + struct.pack("<IIii", 5, 8, 1, 2)))  # fmt: skip


def test_what_unpacks_to_more_than_the_limit_is_refused_in_one_line(tmp_path, monkeypatch):
    path = tmp_path / "zeros.mat"
    path.write_bytes(written({"t": np.arange(10.0), "u": np.zeros(2_000_000)}, do_compression=True))
    assert path.stat().st_size < 30_000
    assert len(read_table(path).columns["u"]) == 2_000_000
    monkeypatch.setattr(mat_structure, "MOST_TABLE", 16_000_000)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"zeros\.mat: its values take more than") as refused:
            read_table(path)
        assert tracemalloc.get_traced_memory()[1] < 40_000_000
    finally:
        tracemalloc.stop()
    assert "\n" not in str(refused.value)


def test_numbers_of_one_byte_count_as_what_they_take_in_memory(monkeypatch):
    data = written({"u": np.zeros(1_000, dtype=np.int8)})
    monkeypatch.setattr(mat_structure, "MOST_TABLE", 8_000)
    assert mat_damage(data) == ""
    monkeypatch.setattr(mat_structure, "MOST_TABLE", 7_999)
    with pytest.raises(InputError, match="take more"):
        mat_damage(data)


def test_compressed_data_without_their_end_are_refused():
    packed = zlib.compress(NUMBERS[128:])[:-6]
    tags = struct.pack("<II", 15, len(packed))
    assert mat_damage(NUMBERS[:128] + tags + packed) == "compressed data cut off"


def test_more_variables_than_any_recording_has_are_refused(monkeypatch):
    monkeypatch.setattr(mat_structure, "_MOST_VARIABLES", 3)
    assert mat_damage(written({"log": {"t": 1.0, "u": 2.0}})) == ""
    with pytest.raises(InputError, match="more than 3 variables"):
        mat_damage(written({"log": {"t": 1.0, "u": 2.0, "x": 3.0}}))


def test_a_file_larger_than_the_limit_is_not_opened(tmp_path):
    with (tmp_path / "a.mat").open("wb") as file:
        file.write(NUMBERS)
        file.truncate(1 << 40)
    with pytest.raises(InputError, match="the file has more than 2 GiB"):
        read_table(tmp_path / "a.mat")
