"""Coast-down: levels and zero command."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.signals import build_signal


def test_drive_then_zero_in_both_directions():
    signal = build_signal(
        "coast_down", sample_time=0.01, amplitude=2.0, drive_time=0.5, coast_time=1.0, fractions=[0.5, 1.0]
    )
    assert signal.value.size == 4 * 150
    levels = []
    for segment in signal.segments:
        drive = signal.value[segment.start : segment.settled]
        assert drive.size == 50
        assert np.all(drive == drive[0])
        assert np.all(signal.value[segment.settled : segment.stop] == 0.0)
        levels.append(float(drive[0]))
    assert levels == [1.0, -1.0, 2.0, -2.0]


def test_one_direction_only():
    signal = build_signal("coast_down", sample_time=0.01, duration=9.0, alternate=False)
    assert np.min(signal.value) == 0.0
    assert signal.segments[-1].stop == 900


@pytest.mark.parametrize(
    "times", [{"drive_time": 1e20}, {"coast_time": 1e308}, {"fractions": [1.0] * 500, "drive_time": 2e3}]
)
def test_times_that_no_memory_holds_are_one_line(times):
    with pytest.raises(InputError, match="samples are too many"):
        build_signal("coast_down", sample_time=0.01, duration=9.0, **times)
