"""Captures of ControlDesk: stamps in X, signals in Y by the paths of their blocks."""

from __future__ import annotations

import numpy as np
from scipy.io import savemat

from idloop.records.formats.control_desk import series_of_capture
from idloop.records.formats.mat import read_mat

T = np.arange(50) * 7.2e-4


def _signal(path, data, clock=1):
    return {"Name": path, "Type": 2.0, "Data": data.astype(np.float32), "Unit": "", "XIndex": float(clock)}


def _capture(signals, stamps=({"Name": "", "Type": 4.0, "Data": T, "Unit": ""},)):
    return {
        "X": np.array(stamps, dtype=object),
        "Y": np.array(signals, dtype=object),
        "Description": {"GeneratorVersion": "ControlDesk MATLAB File Format Revision 2.0"},
        "Capture": {"Length": 0.036, "SamplingPeriod": 1.2e-4},
    }


def test_signals_by_their_blocks_on_the_stamps(tmp_path):
    signals = [
        _signal('"Model Root"/"motor speed [rad/s]"/"Out1"', np.sin(T)),
        _signal('"Model Root"/"duty"/"Out1"', np.cos(T)),
    ]
    savemat(tmp_path / "run.mat", {"run": _capture(signals)})
    table = read_mat(tmp_path / "run.mat", {})
    assert list(table.columns) == ["run.time", "run.motor speed [rad/s]", "run.duty"]
    assert np.allclose(table.columns["run.time"], T)
    assert np.allclose(table.columns["run.duty"], np.cos(T))
    assert table.clocks == {"run.motor speed [rad/s]": "run.time", "run.duty": "run.time"}


def test_one_signal_and_blocks_of_one_name(tmp_path):
    savemat(tmp_path / "one.mat", {"one": _capture([_signal('"Model Root"/"speed"/"Out1"', T)])})
    assert list(read_mat(tmp_path / "one.mat", {}).columns) == ["one.time", "one.speed"]
    signals = [_signal(f'"Model Root"/"axis {k}"/"speed"/"Out1"', k * T) for k in (1, 2)]
    found = series_of_capture({"X": {"Data": T}, "Y": signals})
    assert list(found) == ["time", "Model Root/axis 1/speed/Out1", "Model Root/axis 2/speed/Out1"]


def test_signals_of_two_rates_have_stamps_of_their_own():
    slow = T[::5]
    signals = [_signal('"Model Root"/"speed"/"Out1"', T), _signal('"Model Root"/"heat"/"Out1"', slow, 2)]
    found = series_of_capture({"X": [{"Data": T}, {"Data": slow}], "Y": signals})
    assert {rate: list(own) for rate, own in found.items()} == {"rate1": ["time", "speed"], "rate2": ["time", "heat"]}
    assert len(found["rate2"]["time"]) == len(slow)


def test_other_structures_with_x_and_y_are_none():
    assert series_of_capture({"X": T, "Y": T}) is None
    assert series_of_capture({"X": {"Data": T}, "Y": {"Data": T}}) is None
    assert series_of_capture({"X": {"Data": T}, "Y": _signal('"speed"', T[1:])}) is None
    assert series_of_capture({"X": {"Data": -T}, "Y": _signal('"speed"', T)}) is None
    assert series_of_capture({"X": {"Data": T}, "Y": _signal('"speed"', T, 3)}) is None
