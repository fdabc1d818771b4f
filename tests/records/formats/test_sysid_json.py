"""Tests of SysId one after the other, each a part."""

from __future__ import annotations

import json

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.tables.table_files import read_table

HEAD = {"sysid": True, "test": "Simple", "units": "Rotations", "unitsPerRotation": 1.0}


def _test(begin, rows=5, width=4):
    return [[begin + 0.02 * k, *(float(k + place) for place in range(1, width))] for k in range(rows)]


def _write(tmp_path, content):
    path = tmp_path / "sysid_data.json"
    path.write_text(json.dumps(dict(sorted((HEAD | content).items()))))
    return path


def test_tests_in_the_order_of_their_time(tmp_path):
    path = _write(tmp_path, {"slow-forward": _test(10.0), "fast-forward": _test(30.0), "slow-backward": _test(20.0),
                             "fast-backward": []})  # fmt: skip
    table = read_table(path)
    assert list(table.columns) == ["time", "voltage", "position", "velocity"]
    assert list(table.parts) == ["slow-forward", "slow-backward", "fast-forward"]
    time = table.numbers("time")
    start, stop = table.parts["slow-backward"]
    np.testing.assert_array_equal(np.flatnonzero((start <= time) & (time < stop)), np.arange(5, 10))
    assert table.units == {"time": "s", "voltage": "V", "position": "Rotations", "velocity": "Rotations/s"}
    assert table.clocks["voltage"] == "time"


def test_tests_that_count_from_their_own_beginning(tmp_path):
    table = read_table(_write(tmp_path, {"slow-forward": _test(0.0), "slow-backward": _test(0.0)}))
    assert np.all(np.diff(table.numbers("time")) > 0.0)
    assert "one after the other" in table.notes[0]


def test_tests_by_their_later_names(tmp_path):
    table = read_table(_write(tmp_path, {"quasistatic-forward": _test(0.0), "dynamic-backward": _test(5.0)}))
    assert list(table.parts) == ["quasistatic-forward", "dynamic-backward"]


def test_a_drivetrain(tmp_path):
    table = read_table(_write(tmp_path, {"fast-forward": _test(0.0, width=9)}))
    np.testing.assert_array_equal(table.numbers("right velocity")[:2], [6.0, 7.0])


BAD = {
    "rows of another width": ({"fast-forward": _test(0.0, width=5)}, "rows of 5 numbers"),
    "rows of several widths": ({"fast-forward": [[1, 2, 3, 4], [1, 2]]}, "no list of rows"),
    "no rows": ({"fast-forward": []}, "no tests"),
    "texts": ({"fast-forward": [["a", 1, 2, 3]]}, "no list of rows"),
    "a number": ({"fast-forward": 3}, "no list of rows"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files(tmp_path, name):
    content, words = BAD[name]
    with pytest.raises(InputError, match=words):
        read_table(_write(tmp_path, content))
