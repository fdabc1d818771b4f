"""Lists of runs in JSON are records; samples with vectors, joints and named signals are none."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.io import savemat

from idloop.api.log import recognise
from idloop.records.tables.table_files import read_table

LENGTHS = (30, 12, 20)


def _runs(lengths=LENGTHS, **more):
    return [
        {"kind": "step", "targets": ["a"], "torque": [(-1.0) ** (k // 4) for k in range(count)],
         "angle": [0.1 * k * k for k in range(count)], **more}
        for count in lengths
    ]  # fmt: skip


def _write(tmp_path, content):
    path = tmp_path / "runs.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    "content", [{"config": {"rate": 50}, "data": _runs()}, _runs(), {"data": _runs((30, 30))}, _runs((30,))]
)
def test_each_run_is_a_record(tmp_path, content):
    path = _write(tmp_path, content)
    table = read_table(path)
    assert list(table.columns) == ["torque", "angle"]
    runs = content if isinstance(content, list) else content["data"]
    log = recognise(path, period=0.02)
    assert len(log.runs) == len(runs)
    windows = [window.get("rows", {"start": 0, "stop": 30}) for _, window in log.runs.values()]
    assert [one["stop"] - one["start"] for one in windows] == [len(run["angle"]) for run in runs]
    assert {one.role: one.column for one in log.recognition.guesses} == {"command": "torque", "position": "angle"}


def test_each_element_of_a_structure_array_is_a_record(tmp_path):
    runs = [{"t": 0.02 * np.arange(count), **run} for count, run in zip(LENGTHS, _runs(), strict=True)]
    fields = ("t", "torque", "angle")
    rows = [tuple(np.array(run[key]) for key in fields) for run in runs]
    array = np.array(rows, dtype=[(key, "O") for key in fields])
    savemat(tmp_path / "runs.mat", {"log": array, "gain": 3.0})
    log = recognise(tmp_path / "runs.mat")
    assert len(log.runs) == len(runs)
    assert {one.role: one.column for one in log.recognition.guesses} == {"command": "torque", "position": "angle"}
    assert log.recognition.table.attributes == {"gain": 3.0}


def test_data_to_identify_and_to_validate_with_are_records(tmp_path):
    def of(run):
        torque, angle = np.array(run["torque"]), np.array(run["angle"])
        channels = {"InputData": torque, "OutputData": angle, "InputName": "u1", "OutputName": "y1"}
        return channels | {"Ts": 0.02, "SamplingInstants": np.zeros((0, 0)), "TimeUnit": np.zeros((0, 0))}

    both = {name: of(run) for name, run in zip(("id", "val"), _runs((30, 12)), strict=True)}
    savemat(tmp_path / "sets.mat", both)
    log = recognise(tmp_path / "sets.mat")
    assert len(log.runs) == 2
    assert {one.role: one.column for one in log.recognition.guesses}["command"] == "u1"


def test_what_stands_beside_the_runs_is_kept(tmp_path):
    table = read_table(_write(tmp_path, {"config": {"rate": 50}, "data": _runs()}))
    assert table.attributes == {"config.rate": 50.0}
    assert table.begins == (0, 30, 42)


def test_runs_with_stamps_that_go_on(tmp_path):
    runs = _runs()
    begin = 0.0
    for run in runs:
        run["t"] = [begin + 0.01 * k for k in range(len(run["angle"]))]
        begin = run["t"][-1] + 5.0
    assert len(recognise(_write(tmp_path, runs)).runs) == len(runs)


NO_RUNS = {
    "samples with vectors": [{"t": 0.01 * k, "q": [k, 1, 2], "tau": [1, k, 3]} for k in range(20)],
    "joints": {"joints": _runs((30, 30))},
    "joints with stamps in common": {"time": list(range(30)), "arms": _runs((30, 30))},
    "signals by name": {
        "lines": [{"name": name, "x": list(range(30)), "y": [1.0] * 30} for name in ("torque", "speed")]
    },
}


@pytest.mark.parametrize("name", NO_RUNS)
def test_other_lists_are_no_runs(tmp_path, name):
    assert read_table(_write(tmp_path, NO_RUNS[name])).begins == ()
