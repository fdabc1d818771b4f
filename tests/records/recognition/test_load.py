"""A second position of the same drive: the sensor at the load."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.recognition.guess import Given
from idloop.records.recognition.mapping_file import mapping_of, text_of
from idloop.records.recognition.recognise import recognise_table
from idloop.records.tables.mapping import parse_mapping
from idloop.records.tables.table import Table

T = np.arange(3000) * 0.005
U = np.sign(np.sin(3.0 * T))
PLACE = 2.0 * np.cos(3.0 * T) + T
LOAD = PLACE + 0.05 * U


def _found(columns, given=None):
    return recognise_table(
        Table(Path("log.csv"), columns), {k: Given.parse(v, list(columns)) for k, v in given.items()} if given else None
    )


def _doubts(found):
    return [doubt for doubt in found.all_doubts() if "--load" in doubt]


@pytest.mark.parametrize(
    ("names", "option"),
    [
        (("motor_pos_rad", "load_pos_rad"), ": --load load_pos_rad"),
        (("pos1", "pos2"), ": --load pos1"),
        (("joint angle [rad]", "motor_enc"), ": --position motor_enc --load 'joint angle [rad]'"),
    ],
)
def test_a_second_sensor_is_named_with_what_to_type(names, option):
    place, load = (LOAD, PLACE) if "motor_enc" in names else (PLACE, LOAD)
    (doubt,) = _doubts(_found({"t": T, "torque": U, names[0]: place, names[1]: load}))
    assert doubt.endswith(option)
    assert "two bodies" in doubt


def test_the_same_sensor_in_another_unit_and_another_motion_are_no_load():
    columns = {"t": T, "torque": U, "pos_rad": PLACE, "pos_deg": np.degrees(PLACE), "x2_pos": np.sin(0.7 * T)}
    assert not _doubts(_found(columns))


def test_the_other_side_of_a_vehicle_has_a_command_of_its_own_and_is_no_load():
    left, right = {"left voltage": U, "left position": PLACE}, {"right voltage": 0.9 * U, "right position": LOAD}
    assert not _doubts(_found({"t": T, **left, **right}))
    assert _doubts(_found({"t": T, **left, "right position": LOAD}))


def test_a_load_becomes_a_position_of_a_joint_of_its_own():
    found = _found({"t": T, "torque": U, "motor_pos": PLACE, "load_pos": LOAD}, {"load": "load_pos"})
    assert not _doubts(found)
    mapping = parse_mapping(mapping_of(found, "log", "axis"), "mapping")
    assert [(one.column, one.joint, one.unit) for one in mapping.position] == [
        ("motor_pos", None, "rad"),
        ("load_pos", "load", "rad"),
    ]
    assert "joint: load_side" in text_of(mapping_of(found, "log", "load"))


def test_the_load_of_a_numbered_joint_leaves_the_other_for_the_axis():
    columns = {"t": T, "torque": U, "a1 position": PLACE, "a1 velocity": np.gradient(PLACE, T), "a2 position": LOAD}
    columns["a2 velocity"] = np.gradient(LOAD, T)
    found = _found(columns, {"load": "a2 position"})
    assert found.of("position").column == "a1 position"
    assert found.of("load").column == "a2 position"


def test_a_load_without_a_position_is_refused():
    with pytest.raises(InputError, match="--position"):
        _found({"t": T, "torque": U, "speed": np.gradient(PLACE, T), "pos": LOAD}, {"load": "pos"})
