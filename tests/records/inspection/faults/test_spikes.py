"""A reading off the others is a bad one; a true value that was read late is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.records.inspection.faults.spikes import check


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
    assert check(replace(axis, position=late)) == []


def test_a_reading_that_comes_back_is_a_bad_one(make_axis):
    axis, place = _coasting(make_axis)
    for off in (1.5, -1.5):
        bad = place.copy()
        bad[1005] += off * (place[1006] - place[1005])
        (found,) = check(replace(axis, position=bad))
        assert (found.kind, found.count) == ("spikes", 1)
