"""A control error is neither the command nor a motion, whatever its column stands beside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from idloop.records.recognition.recognise import recognise_table
from idloop.records.tables.table import Table

PERIOD = 0.002
TIME = np.arange(6000) * PERIOD


def _loop(set_point, *, step=0.05, friction=40.0, gain=25.0):
    """Set-point, coarse position and command of a position loop whose axis is mostly friction."""
    place, speed = 0.0, 0.0
    measured, command = np.zeros(TIME.size), np.zeros(TIME.size)
    for k in range(TIME.size):
        measured[k] = step * np.round(place / step)
        command[k] = gain * (set_point[k] - measured[k]) - 0.05 * gain * speed
        speed += PERIOD * (20.0 * command[k] - friction * speed)
        place += PERIOD * speed
    return measured, command


SET_POINTS = {
    "sine": 3.0 * np.sin(1.5 * TIME),
    "steps": 2.0 * np.sign(np.sin(2.0 * TIME)) + (TIME > 6.0),
}


def _roles(columns):
    found = recognise_table(Table(Path("log.csv"), columns), period=PERIOD)
    return {one.role: one.column for one in found.guesses}, found


@pytest.mark.parametrize("kind", SET_POINTS)
@settings(max_examples=12)
@given(order=st.permutations(range(4)), sign=st.sampled_from([1.0, -1.0]))
def test_without_names_the_difference_is_not_used_and_the_fourth_column_is_the_command(kind, order, sign):
    wanted = SET_POINTS[kind]
    measured, command = _loop(wanted)
    four = {"r": wanted, "y": measured, "e": sign * (wanted - measured), "u": command}
    names = [list(four)[place] for place in order]
    roles, found = _roles({f"Channel {k}": four[name] for k, name in enumerate(names)})
    assert {role: names[int(column[-1])] for role, column in roles.items()} == {
        "command": "u",
        "position": "y",
        "reference": "r",
    }
    assert any("control error" in doubt for doubt in found.all_doubts())


def test_beside_a_named_position_the_other_column_of_the_difference_is_the_set_point():
    wanted = SET_POINTS["sine"]
    measured, command = _loop(wanted)
    roles, _ = _roles({"a": wanted - measured, "angle": measured, "b": wanted, "c": command})
    assert roles == {"command": "c", "position": "angle", "reference": "b"}


def test_the_columns_of_a_difference_that_was_rounded_are_told_apart():
    wanted = SET_POINTS["steps"]
    measured, command = _loop(wanted)
    rounded = np.round(wanted - measured + 4e-4 * np.cos(TIME), 3)
    roles, _ = _roles({"col 1": rounded, "col 2": measured, "col 3": wanted, "col 4": command})
    assert roles == {"command": "col 4", "position": "col 2", "reference": "col 3"}


def test_a_velocity_that_is_named_stays_one_beside_columns_that_differ_by_it():
    wanted = SET_POINTS["sine"]
    measured, command = _loop(wanted, step=1e-4)
    speed = np.gradient(measured, PERIOD)
    roles, _ = _roles({"voltage": command, "angle": measured, "velocity": speed, "sum": measured + speed})
    assert (roles["command"], roles["position"], roles["velocity"]) == ("voltage", "angle", "velocity")


def test_a_command_that_runs_with_the_slope_is_no_velocity_beside_a_set_point():
    wanted = 3.0 * np.sin(0.8 * TIME)
    measured, command = _loop(wanted, step=0.01, friction=400.0, gain=500.0)
    roles, _ = _roles({"a": wanted, "b": measured, "c": command})
    assert roles["command"] == "c"
    assert "velocity" not in roles
