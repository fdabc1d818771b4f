"""Missing values are said, and graded where many readings are lost; a sensor slower than the log loses none."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.inspection.values import missing_values

STAMP = np.arange(900) * 10**7


def _said(rows, *, command=False):
    value = np.sin(0.01 * np.arange(STAMP.size))
    value[rows] = np.nan
    (found,) = missing_values("axis.position", STAMP, value, "/joint_states", command=command)
    return found


@pytest.mark.parametrize("rows", [np.random.default_rng(0).permutation(STAMP.size)[:300], np.arange(1, 900, 3)])
def test_many_lost_readings_are_a_warning_with_their_share(rows):
    found = _said(rows)
    assert found.level == "warning"
    assert "300 of 900 values are missing" in found.text
    assert "33 % of its readings are lost" in found.text


def test_few_are_a_note_and_those_of_a_command_a_warning():
    assert _said([100, 400]).level == "note"
    assert _said([100, 400], command=True).level == "warning"


@pytest.mark.parametrize("every", [2, 5])
def test_a_sensor_slower_than_the_log_loses_nothing(every):
    assert _said(np.flatnonzero(np.arange(STAMP.size) % every)).level == "note"


def test_what_a_sensor_does_not_measure_before_it_starts_is_not_lost():
    assert _said(np.arange(300)).level == "note"
