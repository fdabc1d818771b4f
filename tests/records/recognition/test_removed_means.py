"""Means of command and motion that were removed before the log was saved are said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from idloop.records.recognition.recognise import recognise_table
from idloop.records.tables.table import Table

T = np.arange(2000) * 0.02
LEVELS = np.random.default_rng(2).choice([0.5, 1.0, 2.0, 4.0], size=100, p=[0.1, 0.2, 0.3, 0.4])
COMMAND = np.repeat(LEVELS, 20)
SPEED = lfilter([20.0], [1.0, -0.9], COMMAND)


def _doubts(command, speed):
    columns = {"t": T, "input voltage [V]": command, "speed [rad/s]": speed}
    found = recognise_table(Table(Path("log.csv"), columns))
    return [doubt for doubt in found.all_doubts() if "they were removed" in doubt]


def test_signals_of_one_direction_without_their_means():
    (doubt,) = _doubts(np.round(COMMAND - COMMAND.mean(), 6), SPEED - SPEED.mean())
    assert doubt.startswith("the means of 'input voltage [V]' and 'speed [rad/s]' are zero")


def test_signals_as_they_were_recorded():
    assert not _doubts(COMMAND, SPEED)
    assert not _doubts(COMMAND - COMMAND.mean(), SPEED)


def test_a_motion_alike_in_both_directions_has_no_mean_by_itself():
    assert not _doubts(np.sin(2.0 * np.pi * T), np.cos(2.0 * np.pi * T))
