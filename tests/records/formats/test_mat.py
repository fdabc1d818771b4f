"""MATLAB files of both kinds give the same columns; Simulink's structures their labels and stamps."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from tests.records.formats.writers import mat_hdf5

from idloop.errors import InputError
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
    savemat(tmp_path / "log.mat", {"scope": scope, "out": alone})
    table = read_table(tmp_path / "log.mat")
    assert set(table.columns) == {"scope.time", "scope.speed", "scope.u[0]", "scope.u[1]", "out.time", "out.signals"}
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
