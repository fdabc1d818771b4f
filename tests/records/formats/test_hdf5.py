"""Data sets become columns by their path; what lies elsewhere, is no data or takes too much is not read."""

from __future__ import annotations

import pickle
import sys

import h5py
import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.formats import hdf5, isolated
from idloop.records.tables.table_files import read_table

T, U = np.arange(50) * 0.01, np.sin(np.arange(50.0))


def test_data_sets_groups_units_and_clocks(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        run = file.create_group("run1")
        run["time"] = T
        run["time"].attrs["units"] = "ms"
        run.create_dataset("u", data=U, compression="gzip", shuffle=True, chunks=(7,))
        run["u"].attrs["units"] = np.bytes_("V")
        run["y"] = np.column_stack([U, -U])
        run["y"].attrs["unit"] = "rad"
        run["name"] = "motor"
        run["states"] = ["on"] * 49 + ["off"]
        run["slow/temperature"] = U[:10]
        run.attrs["sample_rate"] = 100.0
        run.attrs["title"] = "of the writer"
        file.attrs["rate"] = 100.0
        file.attrs["operator"] = "nobody"
    table = read_table(tmp_path / "log.h5")
    np.testing.assert_array_equal(table.numbers("run1/u"), U)
    np.testing.assert_array_equal(table.numbers("run1/y[1]"), -U)
    assert table.units == {"run1/time": "ms", "run1/u": "V", "run1/y[0]": "rad", "run1/y[1]": "rad"}
    assert table.clocks == dict.fromkeys(("run1/u", "run1/y[0]", "run1/y[1]", "run1/states"), "run1/time")
    kept = {"run1/name": "motor", "run1/sample_rate": 100.0, "rate": 100.0, "operator": "nobody"}
    assert table.attributes == kept
    assert table.raw("run1/states")[-1] == "off"


def test_the_unit_is_an_attribute_in_any_language(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["déplacement"] = np.arange(5.0)
        file["déplacement"].attrs["unité"] = "mm"
    assert read_table(tmp_path / "log.h5").units["déplacement"] == "mm"


def test_compound_data_sets(tmp_path):
    rows = np.zeros(5, dtype=[("t", "f8"), ("u", "f4"), ("state", "S8"), ("q", "f8", (2,))])
    rows["t"], rows["q"] = T[:5], np.arange(10.0).reshape(5, 2)
    with h5py.File(tmp_path / "log.hdf5", "w") as file:
        file["log"] = rows
    table = read_table(tmp_path / "log.hdf5")
    assert {"log/t", "log/u", "log/q[0]", "log/q[1]"} <= set(table.columns)
    assert table.clocks["log/u"] == "log/t"
    np.testing.assert_array_equal(table.numbers("log/q[1]"), np.arange(1.0, 10.0, 2.0))


def test_references_and_texts_in_a_compound_data_set_are_left_out(tmp_path):
    rows = np.zeros(5, dtype=[("t", "f8"), ("name", h5py.string_dtype()), ("u", "f8")])
    rows["name"] = "motor"
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["log"] = rows
    assert set(read_table(tmp_path / "log.h5").columns) == {"log/t", "log/u"}


def test_a_file_that_the_library_never_reads_to_its_end_is_one_line(tmp_path, monkeypatch):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["u"], file["names"] = U, ["one", "two"]
    data = bytearray((tmp_path / "log.h5").read_bytes())
    free = data.index(b"GCOL") + 16 + 2 * 24  # behind two texts, with a size of zero
    assert data[free : free + 2] == b"\0\0"
    data[free + 8 : free + 16] = bytes(8)
    (tmp_path / "log.h5").write_bytes(data)
    with pytest.raises(InputError, match=r"the heap of texts at byte [0-9]+ is damaged"):
        read_table(tmp_path / "log.h5")
    monkeypatch.setattr(hdf5, "heap_damage", lambda path: "")
    monkeypatch.setattr(isolated, "LONGEST", 0.5)
    with pytest.raises(InputError, match="its reader does not come to an end"):
        read_table(tmp_path / "log.h5")


def test_tables_and_frames_of_pandas(tmp_path):
    packed = np.zeros(4, dtype=[("index", "i8"), ("values_block_0", "f8", (2,))])
    packed["values_block_0"] = np.arange(8.0).reshape(4, 2)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["df/table"] = packed
        file["df/table"].attrs["values_block_0_kind"] = np.bytes_(pickle.dumps(["u", "speed"], protocol=0))
        file["fixed/axis1"] = np.arange(4)
        file["fixed/block0_items"] = np.array([b"t", b"u"])
        file["fixed/block0_values"] = np.arange(8.0).reshape(4, 2)
    table = read_table(tmp_path / "log.h5")
    np.testing.assert_array_equal(table.numbers("df/table/speed"), [1.0, 3.0, 5.0, 7.0])
    np.testing.assert_array_equal(table.numbers("fixed/u"), [1.0, 3.0, 5.0, 7.0])


def test_links_elsewhere_are_not_followed(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["secret"] = U
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["u"] = U
        file["away"] = h5py.ExternalLink("other.h5", "secret")
        file["again"] = h5py.SoftLink("/u")
        (tmp_path / "raw").write_bytes(bytes(80))
        file.create_dataset("outside", (10,), "f8", external=[(str(tmp_path / "raw"), 0, 80)])
        file["round"] = h5py.SoftLink("/")
    assert set(read_table(tmp_path / "log.h5").columns) == {"u"}


def test_a_group_within_itself_is_one_line(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        group = file.create_group("a")
        group["again"] = group
    with pytest.raises(InputError, match="groups more than 64 deep"):
        read_table(tmp_path / "log.h5")


def test_what_takes_too_much_is_not_unpacked(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("u", (1 << 40,), "f8", chunks=(1 << 16,), compression="gzip")
    with pytest.raises(InputError, match="take more than 2 GiB with /u"):
        read_table(tmp_path / "log.h5")


def test_damaged_files_are_one_line(tmp_path, monkeypatch):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["u"] = U
    data = (tmp_path / "log.h5").read_bytes()
    (tmp_path / "cut.h5").write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match="not a readable HDF5 file") as caught:
        read_table(tmp_path / "cut.h5")
    assert "\n" not in str(caught.value)


def test_without_the_library_the_line_says_how_to_get_it(tmp_path, monkeypatch):
    (tmp_path / "log.h5").write_bytes(hdf5.HDF5_SIGNATURE + bytes(100))
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(InputError, match=r"h5py .* is not installed; run: pip install 'idloop\[formats\]'"):
        read_table(tmp_path / "log.h5")
