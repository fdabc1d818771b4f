"""Of many columns without names, the one that is held in steps is the command of those that follow it."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.api.log import recognise
from idloop.errors import InputError

LEVELS = (0.0, 15.0, -24.0, 38.0, 5.0, -50.0, 46.0, -12.0)
ROWS = 500


def _wheels(path, *, levels=LEVELS, flags=()):
    """A set-point and the speeds of four wheels, which follow it with a time constant of their own."""
    rng = np.random.default_rng(4)
    asked = np.repeat(levels, ROWS)
    speeds = []
    for wheel in range(4):
        share, speed = 0.12 + 0.02 * wheel, np.zeros(asked.size)
        for k in range(1, asked.size):
            speed[k] = speed[k - 1] + share * (asked[k - 1] - speed[k - 1])
        speeds.append(np.round((speed + 0.3 * rng.normal(size=asked.size)) / 0.23) * 0.23)
    np.savetxt(path, np.column_stack([asked, *speeds, *flags]), delimiter=",", fmt="%.6g")
    return path


def test_the_set_point_of_four_wheels_is_the_command(tmp_path):
    found = recognise(_wheels(tmp_path / "wheels.csv"), period=0.005)
    roles = {one.role: one.column for one in found.recognition.guesses}
    assert roles.keys() == {"command", "velocity"}
    assert roles["command"] == "0"
    assert roles["velocity"] in {"1", "2", "3", "4"}
    assert any("no name says what '0' is" in doubt for doubt in found.doubts)


def test_the_set_point_that_the_user_names_is_followed_as_well(tmp_path):
    found = recognise(_wheels(tmp_path / "wheels.csv"), {"command": "0=rad/s"}, period=0.005)
    assert found.recognition.of("command").unit == "rad/s"
    assert found.recognition.of("velocity").column in {"1", "2", "3", "4"}


def test_a_flag_beside_it_is_no_second_command(tmp_path):
    flag = np.repeat(np.arange(len(LEVELS)) % 2, ROWS)
    found = recognise(_wheels(tmp_path / "wheels.csv", flags=[flag]), period=0.005)
    assert found.recognition.of("command").column == "0"


def test_nothing_is_guessed_where_two_columns_are_held_in_steps(tmp_path):
    other = np.repeat(np.roll(LEVELS, 3), ROWS)
    with pytest.raises(InputError, match="no column is a position or a velocity"):
        recognise(_wheels(tmp_path / "wheels.csv", flags=[other]), period=0.005)


def test_nothing_is_guessed_where_nothing_follows(tmp_path):
    rng = np.random.default_rng(0)
    walk = np.cumsum(rng.normal(size=(len(LEVELS) * ROWS, 4)), axis=0)
    np.savetxt(tmp_path / "other.csv", np.column_stack([np.repeat(LEVELS, ROWS), walk]), delimiter=",", fmt="%.6g")
    with pytest.raises(InputError, match="no column is a position or a velocity"):
        recognise(tmp_path / "other.csv", period=0.005)
