"""What `ros2 topic echo` and `rostopic echo` print is read by the paths of the values."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.formats.registry import form_of
from idloop.records.tables.table_files import read_table

ROS2 = """header:
  stamp:
    sec: 1700000000
    nanosec: {k}0000000
  frame_id: ''
name:
- motor
position:
- {k}.5
- -1.0e-3
velocity: []
poses:
- x: {k}
  y: 2
- x: 3
  y: .nan
effort:
- '...'
---
"""
ROS1 = """header:
  seq: {k}
  stamp:
    secs: 1700000000
    nsecs: {k}0000000
  frame_id: ''
name: [motor, "other one"]
position: [{k}.5, -0.001]
---
"""


def _read(tmp_path, text):
    path = tmp_path / "echo.txt"
    path.write_text(text)
    assert form_of(path).kind == "echo"
    return read_table(path)


def test_ros2(tmp_path):
    table = _read(tmp_path, "".join(ROS2.format(k=k) for k in range(10, 14)))
    assert list(table.columns) == [
        "header.stamp.sec", "header.stamp.nanosec", "header.frame_id", "name[0]", "position[0]", "position[1]",
        "poses[0].x", "poses[0].y", "poses[1].x", "poses[1].y", "effort[0]", "stamp",
    ]  # fmt: skip
    np.testing.assert_array_equal(table.numbers("position[0]"), [10.5, 11.5, 12.5, 13.5])
    np.testing.assert_array_equal(table.numbers("poses[0].x"), [10, 11, 12, 13])
    assert np.isnan(table.numbers("poses[1].y")).all()
    np.testing.assert_allclose(table.numbers("stamp") - 1.7e9, [0.1, 0.11, 0.12, 0.13], atol=1e-6)


def test_ros1(tmp_path):
    table = _read(tmp_path, "".join(ROS1.format(k=k) for k in range(10, 14)))
    np.testing.assert_array_equal(table.numbers("position[0]"), [10.5, 11.5, 12.5, 13.5])
    np.testing.assert_array_equal(table.numbers("position[1]"), np.full(4, -0.001))
    assert table.raw("name[1]")[0] == "other one"
    np.testing.assert_allclose(table.numbers("stamp") - 1.7e9, [0.1, 0.11, 0.12, 0.13], atol=1e-6)


def test_a_message_that_is_cut_off_is_left_out(tmp_path):
    table = _read(tmp_path, "".join(ROS1.format(k=k) for k in range(10, 14)) + "header: \n  seq: 9\n")
    assert len(table.columns["position[0]"]) == 4
    assert "the last message is cut off and left out" in table.notes


def test_no_message(tmp_path):
    path = tmp_path / "echo.txt"
    path.write_text("---\n---\n")
    with pytest.raises(InputError, match="no message is whole"):
        read_table(path, "echo")


@pytest.mark.parametrize("text", ["a: 1\n---\nb: 2\n", "t,u\n---\n0,1\n1,2\n", "a: 1\na: 2\na: 3\n"])
def test_other_texts(tmp_path, text):
    path = tmp_path / "a.txt"
    path.write_text(text)
    assert form_of(path).kind != "echo"
