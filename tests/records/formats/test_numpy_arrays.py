"""One array of NumPy in a file."""

from __future__ import annotations

import io

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.tables.table_files import read_table


def _npy(array, **options):
    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


def test_columns_by_position_and_fields_by_name(tmp_path):
    (tmp_path / "a.npy").write_bytes(_npy(np.arange(12.0).reshape(6, 2)))
    (tmp_path / "b.npy").write_bytes(_npy(np.arange(6.0)))
    (tmp_path / "c.npy").write_bytes(_npy(np.zeros(6, dtype=[("t", "f8"), ("u", "i4")])))
    matrix = read_table(tmp_path / "a.npy")
    assert list(matrix.columns) == ["0", "1"]
    np.testing.assert_array_equal(matrix.numbers("1"), np.arange(1.0, 12.0, 2.0))
    assert list(read_table(tmp_path / "b.npy").columns) == ["0"]
    assert list(read_table(tmp_path / "c.npy").columns) == ["t", "u"]


def test_fields_of_an_array_in_an_archive(tmp_path):
    np.savez(tmp_path / "a.npz", log=np.zeros(6, dtype=[("t", "f8"), ("u", "i4")]))
    table = read_table(tmp_path / "a.npz")
    assert list(table.columns) == ["log.t", "log.u"]
    assert table.clocks == {"log.u": "log.t"}


HUGE = io.BytesIO()
np.lib.format.write_array_header_1_0(HUGE, {"descr": "<f8", "fortran_order": False, "shape": (1 << 40,)})
BAD = {
    "a pickle": (
        _npy(np.array([{}], dtype=object), allow_pickle=True),
        "pickled objects of Python, .* save plain arrays",
    ),
    "cut off": (_npy(np.arange(100.0))[:-8], "not a readable NPY file"),
    "a size without data": (HUGE.getvalue(), "it takes 8.19e"),
    "a header that is code": (b"\x93NUMPY\x01\x00\x10\x00" + b"__import__('os')", "not a readable NPY file"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files(tmp_path, name):
    data, words = BAD[name]
    (tmp_path / "a.npy").write_bytes(data)
    with pytest.raises(InputError, match=words) as caught:
        read_table(tmp_path / "a.npy")
    assert "\n" not in str(caught.value)


def test_settings_as_objects_beside_the_arrays_are_left_out(tmp_path):
    np.savez(tmp_path / "a.npz", t=np.arange(6.0), u=np.arange(6.0), meta=np.array({"joint": 3}, dtype=object))
    table = read_table(tmp_path / "a.npz")
    assert list(table.columns) == ["t", "u"]
    assert table.notes == ["objects of Python are never opened, and left out: meta"]


def test_an_archive_of_nothing_but_objects(tmp_path):
    np.savez(tmp_path / "a.npz", log=np.array({"t": [0.0, 1.0]}, dtype=object))
    with pytest.raises(InputError, match=r"pickled objects of Python, .* save plain arrays"):
        read_table(tmp_path / "a.npz")


def test_an_array_of_three_dimensions_is_left_out_and_said(tmp_path):
    np.savez(tmp_path / "a.npz", T=np.arange(20.0), U=np.ones((5, 20)), Y=np.ones((5, 20, 2)))
    table = read_table(tmp_path / "a.npz")
    assert "Y" not in " ".join(table.columns)
    assert table.notes == ["'Y' has 5 x 20 x 2 values and is left out; save a matrix or a file for each record"]
