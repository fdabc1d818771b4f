"""Identification data of MATLAB: channels by their names, with their units and stamps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import savemat

from idloop.api.log import recognise
from idloop.records.formats.mat import series_of_iddata
from idloop.records.tables.table_files import read_table

K = np.arange(50.0)


def _cell(*values):
    cell = np.empty((1, len(values)), dtype=object)
    cell[0, :] = values
    return cell


def _data(**changed):
    """Fields as scipy reads them of an object and of a structure alike."""
    own = {
        "Domain": "Time", "OutputData": np.sin(K)[:, None], "OutputName": _cell("Angular Velocity"),
        "OutputUnit": _cell("rad/s"), "InputData": np.sign(np.sin(K))[:, None], "InputName": _cell("Motor Voltage"),
        "InputUnit": _cell("V"), "Ts": 0.02, "Tstart": np.zeros((0, 0)), "SamplingInstants": np.zeros((0, 0)),
        "TimeUnit": "seconds", "ExperimentName": _cell("Exp1"),
    }  # fmt: skip
    return own | changed


def test_channels_stamps_and_units(tmp_path):
    savemat(tmp_path / "a.mat", {"data": _data()})
    table = read_table(tmp_path / "a.mat")
    assert [name for name in table.columns if name in table.clocks] == ["data.Motor Voltage", "data.Angular Velocity"]
    np.testing.assert_allclose(table.numbers("data.Time"), 0.02 * K)
    assert table.units == {"data.Time": "seconds", "data.Motor Voltage": "V", "data.Angular Velocity": "rad/s"}
    found = recognise(tmp_path / "a.mat").recognition
    assert {one.role: one.column for one in found.guesses} == {
        "command": "data.Motor Voltage", "velocity": "data.Angular Velocity"
    }  # fmt: skip
    assert found.all_doubts() == []


def test_an_empty_unit_of_time_is_seconds():
    columns, _ = series_of_iddata(_data(TimeUnit=np.zeros((0, 0))))
    assert columns["VariableUnits"]["Time"] == "s"


def test_experiments_are_parts(tmp_path):
    both = {key: _cell(one, one[:30]) for key, one in _data().items() if key in ("InputData", "OutputData")}
    changed = both | {"Ts": _cell(0.02, 0.02), "ExperimentName": _cell("up", "down")}
    savemat(tmp_path / "a.mat", {"data": _data(**changed)})
    table = read_table(tmp_path / "a.mat")
    time = table.numbers("data.Time")
    start, stop = table.parts["down"]
    assert list(table.parts) == ["up", "down"]
    assert np.sum((start <= time) & (time < stop)) == 30


@pytest.mark.parametrize("changed", [{"Ts": np.zeros((0, 0))}, {"OutputData": np.zeros((3, 1))}])
def test_data_without_stamps_or_of_unequal_length_stay_as_they_are(changed):
    assert series_of_iddata(_data(**changed)) is None
    assert series_of_iddata({"InputData": K}) is None
