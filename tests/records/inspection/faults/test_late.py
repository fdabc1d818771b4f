"""A motion that comes before its command is named with the time; a drive that is late is not."""

from dataclasses import replace

import numpy as np
import pytest

from idloop.records.inspection.faults import late

RATE = 200.0


@pytest.mark.parametrize("samples", [5, 10, 40])
def test_a_command_that_was_recorded_late_is_named(make_axis, samples):
    stamps = make_axis(rate=RATE).input_time + samples / RATE
    found = late.late_command(replace(make_axis(rate=RATE), input_time=stamps))
    assert found.evidence["command_late"] == pytest.approx(samples / RATE, abs=1.01 / RATE)
    assert "identification" in found.spoils


def test_a_command_that_was_recorded_one_sample_late_is_named_where_the_position_shows_it(make_axis):
    axis = make_axis(rate=100.0)
    assert late.late_command(axis) is None
    command = np.concatenate([axis.command[:1], axis.command[:-1]])
    found = late.late_command(replace(axis, command=command))
    assert found.evidence["command_late"] == pytest.approx(0.01, rel=1e-6)
    assert found.spoils == ("delays",)
    assert "--late 0.01" in found.cure


@pytest.mark.parametrize("samples", [0, 1, 3, 10, 40])
def test_a_drive_that_is_late_or_in_time_has_no_fault(make_axis, samples):
    waiting = [0.0] * samples

    def drive(value: float) -> float:
        waiting.append(value)
        return waiting.pop(0)

    assert late.late_command(make_axis(rate=RATE, drive=drive)) is None


def test_a_motion_without_a_command_has_no_fault(make_axis):
    still = np.zeros(3000)
    assert late.late_command(make_axis(rate=RATE, command=still)) is None
