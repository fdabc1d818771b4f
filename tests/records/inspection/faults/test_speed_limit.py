"""One stay at the largest speed is no limit, however often noise takes the speed out of the band."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults import speed_limit


def axis(stays: int) -> Axis:
    """Drive an axis up to the largest speed under a large command, and keep it there under a smaller one."""
    time = np.arange(12_000) / 2000.0
    phase = np.mod(time, time[-1] / stays + 1e-9) / (time[-1] / stays)
    speed = np.interp(phase, [0.0, 0.7, 0.75, 0.9, 1.0], [0.0, 7.15, 7.2, 7.15, 0.0])
    command = np.where(phase < 0.75, 2.5, 1.7)
    noisy = speed + 0.1 * np.random.default_rng(0).normal(size=time.size)
    units = {"j.velocity": "rad/s", "j.effort": "V"}
    return Axis("j", time, None, noisy, time, command, "j.effort", units)


@pytest.mark.parametrize(("stays", "named"), [(1, False), (3, True)])
def test_a_speed_that_is_reached_several_times_is_a_limit(stays, named):
    assert bool(speed_limit.check(axis(stays))) == named
