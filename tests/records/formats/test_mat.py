"""MATLAB files of both kinds give the same columns; Simulink's structures their labels and stamps."""

from __future__ import annotations

import io
import struct
import zlib

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from tests.records.formats.writers import mat_hdf5

from idloop.errors import InputError
from idloop.records.formats import isolated
from idloop.records.tables.table_files import read_table

T, U = np.arange(50) * 0.01, np.sin(np.arange(50.0))
CONTENT = {
    "log": {"t": T, "u": U, "name": "motor", "inner": {"on": U > 0}},
    "gain": 2.5,
    "y": np.column_stack([U, -U, T]),
    "note": "made by hand",
    "runs": [{"t": T, "u": U}, {"t": T[:9], "u": U[:9]}],
    "counts": np.arange(50, dtype=np.int32),
}
COLUMNS = {"log.t", "log.u", "log.inner.on", "y[0]", "y[1]", "y[2]", "runs[0].t", "runs[0].u", "runs[1].t", "runs[1].u",
           "counts"}  # fmt: skip


@pytest.mark.parametrize("version", ("5", "7.3"))
def test_the_same_columns_of_both_versions(tmp_path, version):
    path = tmp_path / "log.mat"
    if version == "5":
        savemat(path, CONTENT | {"log": CONTENT["log"] | {"t": T[:, None]}})
    else:
        mat_hdf5(path, CONTENT)
    table = read_table(path)
    assert set(table.columns) == COLUMNS
    for name, values in (
        ("log.u", U),
        ("y[1]", -U),
        ("runs[1].u", U[:9]),
        ("counts", np.arange(50)),
        ("log.inner.on", U > 0),
    ):
        np.testing.assert_array_equal(table.numbers(name), values)
    assert table.attributes == {"gain": 2.5, "note": "made by hand", "log.name": "motor"}
    assert table.clocks["log.u"] == "log.t"
    assert table.clocks["runs[1].u"] == "runs[1].t"
    assert "y[0]" not in table.clocks


def test_signals_of_simulink_by_their_labels(tmp_path):
    scope = {
        "time": T,
        "signals": [{"values": U, "label": "speed"}, {"values": np.column_stack([U, -U]), "label": "u"}],
        "blockName": "motor/Scope",
    }  # fmt: skip
    alone = {"time": T[:20], "signals": {"values": U[:20], "label": "", "dimensions": 1.0}}
    told = alone | {"blockName": "motor/Speed"}  # the variable may be called otherwise
    savemat(tmp_path / "log.mat", {"scope": scope, "out": alone, "Position": told})
    table = read_table(tmp_path / "log.mat")
    assert set(table.columns) == {
        "scope.time", "scope.speed", "scope.u[0]", "scope.u[1]", "out.time", "out.signals", "Position.time",
        "Position.Speed",
    }  # fmt: skip
    assert table.clocks["scope.u[1]"] == "scope.time"
    assert table.clocks["out.signals"] == "out.time"


def test_elements_of_a_data_set_by_their_names(tmp_path):
    elements = [{"Name": name, "Values": {"Time": T[:n], "Data": U[:n], "DataInfo": {"Units": unit}}}
                for name, n, unit in (("speed", 50, "rpm"), ("current", 20, "A"))]  # fmt: skip
    savemat(tmp_path / "log.mat", {"logsout": np.array(elements, dtype=object), "one": elements[0]})
    table = read_table(tmp_path / "log.mat")
    assert table.clocks["logsout.speed.Data"] == "logsout.speed.Time"
    assert table.clocks["logsout.current.Data"] == "logsout.current.Time"
    assert table.units["logsout.speed.Data"] == "rpm"
    assert len(table.columns["logsout.current.Time"]) == 20


def test_a_series_that_is_a_structure(tmp_path):
    savemat(
        tmp_path / "log.mat", {"speed": {"Time": T, "Data": U, "Name": "speed"}, "u": {"time_ms": T[:9], "v": U[:9]}}
    )
    table = read_table(tmp_path / "log.mat")
    assert table.clocks == {"speed.Data": "speed.Time", "u.v": "u.time_ms"}
    assert table.units == {"u.time_ms": "ms"}


def test_objects_are_named(tmp_path):
    mat_hdf5(tmp_path / "log.mat", {"u": U})
    with h5py.File(tmp_path / "log.mat", "a") as file:
        data = file.create_dataset("speed", data=np.zeros((1, 6), dtype=np.uint32))
        data.attrs["MATLAB_class"] = np.bytes_("timeseries")
        data.attrs["MATLAB_object_decode"] = np.int32(3)
    table = read_table(tmp_path / "log.mat")
    assert set(table.columns) == {"u"}
    assert table.notes[0].startswith("'speed' is an object that only MATLAB reads")
    with h5py.File(tmp_path / "log.mat", "a") as file:
        del file["u"]
    with pytest.raises(InputError, match="save what it holds as plain arrays"):
        read_table(tmp_path / "log.mat")


def test_cells_of_texts_and_empty_variables(tmp_path):
    mat_hdf5(tmp_path / "log.mat", {"u": U, "names": ["one", "three"], "parts": [U[:3], U[:5]], "none": ""})
    table = read_table(tmp_path / "log.mat")
    assert table.raw("names") == ["one", "three"]
    assert {"u", "parts[0]", "parts[1]"} <= set(table.columns)


@pytest.mark.parametrize("version", ("5", "7.3"))
def test_texts_beside_a_matrix_name_its_columns(tmp_path, version):
    path, matrix = tmp_path / "log.mat", np.column_stack([T, U, -U])
    names = ["time", "current", "angle"]
    content = {"data": matrix, "log": {"y": matrix[:, :2].T, "x": U, "labels": ["u", "x"]}, "column_name": names}
    if version == "5":
        cells = {"column_name": np.array(names, dtype=object), "log": content["log"] | {"labels": np.array(["u", "x"])}}
        savemat(path, content | cells)
    else:
        mat_hdf5(path, content)
    table = read_table(path)
    assert {"time", "current", "angle", "log.u", "log.y.x", "log.x"} == set(table.columns)
    np.testing.assert_array_equal(table.numbers("angle"), -U)
    np.testing.assert_array_equal(table.numbers("log.y.x"), U)
    assert "time" not in table.clocks


def test_series_of_two_lengths_have_the_clock_of_theirs(tmp_path):
    short = np.arange(40) * 0.0125
    savemat(tmp_path / "log.mat", {"t_NI": T, "F": U, "t_MR": short, "v": np.cos(short)})
    assert read_table(tmp_path / "log.mat").clocks == {"F": "t_NI", "v": "t_MR"}
    # Two clocks of one length, or one alone, say nothing of the others.
    for more in ({"t_b": T + 1.0}, {"v": U[:40]}):
        savemat(tmp_path / "other.mat", {"t": T, "u": U} | more)
        assert not read_table(tmp_path / "other.mat").clocks


def written(content, **options):
    file = io.BytesIO()
    savemat(file, content, **options)
    return file.getvalue()


NUMBERS = written({"t": np.arange(40.0)})
HEAD, TAG = NUMBERS[:128], struct.pack("<II", 9, 320)  # 40 numbers of eight bytes
CUT = zlib.compress(NUMBERS[128:])[:-6]
TWO = written({"log": {"t": np.arange(3.0), "u": np.arange(3.0)}})
STRUCTURE = struct.pack("<IIIIII", 6, 8, 2, 0, 5, 8)


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(NUMBERS.replace(TAG, struct.pack("<II", 0x89, 320)), id="a type that there is not"),
        pytest.param(NUMBERS.replace(TAG, struct.pack("<II", 14, 320)), id="numbers of the type of a variable"),
        pytest.param(NUMBERS.replace(TAG, struct.pack("<II", 9, 328)), id="more bytes than are left"),
        pytest.param(NUMBERS[:-3], id="cut in a variable"),
        pytest.param(NUMBERS[:132], id="cut in a tag"),
        pytest.param(NUMBERS[:100], id="cut in its header"),
        pytest.param(HEAD + struct.pack("<II", 5, 0), id="no variable"),
        pytest.param(HEAD + struct.pack("<II", 14, 0), id="a variable without its flags"),
        pytest.param(HEAD + struct.pack("<IIII", 15, 8, 1, 2), id="damaged compression"),
        pytest.param(HEAD + struct.pack("<II", 15, len(CUT)) + CUT, id="compression cut off"),
        pytest.param(
            TWO.replace(STRUCTURE + struct.pack("<ii", 1, 1), STRUCTURE + struct.pack("<ii", 1, 2)),
            id="a structure with fewer values than names",
        ),
    ],
)
def test_tags_that_lie_end_no_more_than_the_reader(tmp_path, data):
    assert data != NUMBERS
    path = tmp_path / "run.mat"
    path.write_bytes(data)
    with pytest.raises(
        InputError, match=r"run\.mat: not a readable MAT file .*; check the copy of the file"
    ) as refused:
        read_table(path)
    assert "\n" not in str(refused.value)


def test_a_cell_within_cells_is_what_it_holds(tmp_path):
    cell = T
    for _ in range(150):
        box = np.empty(1, dtype=object)
        box[0] = cell
        cell = box
    (tmp_path / "deep.mat").write_bytes(written({"deep": cell}))
    np.testing.assert_array_equal(read_table(tmp_path / "deep.mat").columns["deep"], T)


def test_version_4_and_matrices_of_which_most_is_zero(tmp_path):
    from scipy.sparse import csc_array

    (tmp_path / "old.mat").write_bytes(written({"t": T}, format="4"))
    (tmp_path / "sparse.mat").write_bytes(written({"t": T, "s": csc_array(np.eye(3))}))
    for name in ("old.mat", "sparse.mat"):
        assert set(read_table(tmp_path / name).columns) == {"t"}


def test_what_unpacks_to_more_than_the_limit_is_refused_in_one_line(tmp_path, monkeypatch):
    path = tmp_path / "zeros.mat"
    path.write_bytes(written({"t": T, "u": np.zeros(20_000_000)}, do_compression=True))
    assert path.stat().st_size < 300_000
    monkeypatch.setattr(isolated, "_ROOM", 64_000_000)
    with pytest.raises(InputError, match=r"zeros\.mat: its values take more than") as refused:
        read_table(path)
    assert "\n" not in str(refused.value)


def test_a_file_larger_than_the_limit_is_not_opened(tmp_path):
    with (tmp_path / "a.mat").open("wb") as file:
        file.write(NUMBERS)
        file.truncate(1 << 40)
    with pytest.raises(InputError, match="the file has more than 2 GiB"):
        read_table(tmp_path / "a.mat")
