"""A reading off the others is a bad one; a true value that was read late is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.spikes import spikes


def _coasting(make_axis):
    """Let an axis turn fast, by a step that is large beside its noise from sample to sample."""
    axis = make_axis()
    place = 30.0 * axis.time + 5.0 * np.sin(5.0 * axis.time)
    place += 1e-4 * np.random.default_rng(0).normal(size=place.size)
    return replace(axis, position=place, velocity=None), place


def test_a_sample_that_was_read_late_is_no_bad_reading(make_axis):
    axis, place = _coasting(make_axis)
    late = place.copy()
    late[1005] += 0.7 * (place[1006] - place[1005])
    assert spikes(replace(axis, position=late)) == []


def test_a_reading_that_comes_back_is_a_bad_one(make_axis):
    axis, place = _coasting(make_axis)
    for off in (1.5, -1.5):
        bad = place.copy()
        bad[1005] += off * (place[1006] - place[1005])
        (found,) = spikes(replace(axis, position=bad))
        assert (found.kind, found.count) == ("spikes", 1)


@pytest.mark.parametrize("fault", [0.0, 2e-3])
def test_a_mass_that_is_thrown_back_where_play_closes_is_no_bad_reading(fault):
    """A stage runs to and fro between the flanks of a nut; at the turns its speed changes its sign within a sample."""
    time = np.arange(3000) / 1000.0
    phase = np.mod(time, 0.6)
    place = np.round(np.hypot(phase - 0.30003, 4e-4) * (1.0 + 0.2 * np.sin(3.0 * time)) / 5e-7) * 5e-7
    place[450] += fault
    units = {"j.position": "m"}
    found = spikes(Axis("j", time, place, None, units=units))
    assert [one.count for one in found] == ([1] if fault else [])
