"""Readings far outside of all others are named and left out; they hide neither the motion nor other faults."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.records import check_record, inspect_bag, write_bag
from idloop.records.inspection.values import bad_readings
from idloop.records.record import Record

ROWS = [3, 700, 701, 1500, 1999]


def spoilt(record, signal):
    changed = record.input.copy() if signal == "motor.effort" else record.output.copy()
    if signal == "motor.effort":
        changed[ROWS] = 65535.0
        return replace(record, input=changed)
    changed[ROWS, record.column(signal)] = 65535.0
    return replace(record, output=changed)


@pytest.mark.parametrize("signal", ["motor.position", "motor.velocity", "motor.effort"])
def test_an_overflow_does_not_hide_the_motion(tmp_path, record, signal):
    found = inspect_bag(write_bag(tmp_path / "bag", spoilt(record, signal)))
    assert (found.verdict, found.grade) == ("usable", "usable with care")
    (fault,) = found.faults
    assert (fault.kind, fault.where, fault.count) == ("spikes", signal, 5)
    assert fault.evidence["largest"] == pytest.approx(65535.0, rel=0.01)
    assert [start <= row / 1000 <= stop for (start, stop), row in zip(fault.places, ROWS, strict=True)] == [True] * 5


def test_a_fit_gets_a_record_without_them(record):
    position, command = (check_record(spoilt(record, name)) for name in ("motor.position", "motor.effort"))
    assert np.flatnonzero(np.isnan(position.output[:, 0])).tolist() == ROWS
    np.testing.assert_array_equal(position.output[:, 1], record.output[:, 1])
    # The command before holds.
    np.testing.assert_array_equal(command.input[ROWS], record.input[[2, 699, 699, 1498, 1998]])
    assert [one.count for one in position.findings if one.kind == "spikes"] == [5]


@pytest.mark.parametrize(
    "value",
    [
        np.sin(np.arange(500) / 20),
        np.where(np.arange(500) % 100 < 2, 1.0, 0.0),  # kicks of a command at rest
        np.where(np.arange(500) == 77, 1.0, 0.0),  # a step of a sensor at rest
        np.mod(0.01 * np.arange(500), 2.0),  # wraps
        np.random.default_rng(0).standard_t(3, size=500),
        np.repeat([0.0, 300.0, 0.0], [200, 4, 296]) + 0.01 * np.arange(500),  # a short motion
    ],
)
def test_what_belongs_to_a_motion_is_none(value):
    assert bad_readings(value).size == 0


def test_values_of_any_size(record):
    spoilt = np.where(np.arange(2000) == 77, 1e300, record.output[:, 0])
    assert bad_readings(spoilt).tolist() == [77]
    assert bad_readings(np.where(np.arange(2000) == 9, np.nan, spoilt)).tolist() == [77]


def test_readings_near_the_others_are_left_out_as_well(make_axis):
    axis = make_axis()
    place = axis.position.copy()
    rows = np.array([400, 900, 1501, 2222])
    place[rows] += 0.3 * np.ptp(place)
    record = Record(
        "log", axis.time, axis.command, axis.time, place[:, None], "j.effort", "V", ("j.position",), ("rad",)
    )  # fmt: skip
    checked = check_record(record)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(checked.output[:, 0])), rows)
    assert [one.kind for one in checked.findings if one.kind == "spikes"] == ["spikes"]
