"""A velocity that its sensor cuts off is named, and told from a wrong scale, a limit of the drive and coarse steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.records.inspection.velocity_check import wrong_velocities
from idloop.records.inspection.velocity_limit import velocity_limit


def _limit(axis, velocity):
    return velocity_limit(axis.time, axis.position, velocity)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.85])
def test_a_velocity_that_is_cut_off_has_the_limit(make_axis, share):
    axis = make_axis()
    most = share * float(np.max(np.abs(axis.velocity)))
    found = _limit(axis, np.clip(axis.velocity, -most, most))
    assert abs(found.value) == pytest.approx(most)
    assert found.faster > 1.03
    one_side = _limit(axis, np.minimum(axis.velocity, most))
    assert one_side.value == pytest.approx(most)
    assert one_side.share < found.share


def test_other_velocities_have_no_limit(make_axis):
    axis = make_axis()
    velocity, step = axis.velocity, np.ptp(axis.velocity) / 12.0
    others = [
        velocity,
        0.8 * velocity,
        np.round(velocity / step) * step,
        np.trunc(velocity / step) * step,
        0.0 * velocity,
    ]
    assert [_limit(axis, one) for one in others] == [None] * len(others)
    # A cut velocity in a wrong unit is in a wrong unit first.
    assert _limit(axis, 9.55 * np.clip(velocity, -1.0, 1.0)) is None
    # What the drive does not exceed is the speed itself.
    held = make_axis(command=np.repeat([1.0, 0.0, -1.0, 0.0], 750))
    assert _limit(held, held.velocity) is None


def test_the_finding_names_the_limit_and_fits_leave_the_velocity_out(make_axis):
    axis = make_axis()
    most = 0.5 * float(np.max(np.abs(axis.velocity)))
    cut = replace(axis, velocity=np.clip(axis.velocity, -most, most))
    (found,) = wrong_velocities(axis.time, cut.columns, cut.units)
    assert found.kind == "wrong_velocity"
    assert "stays at its limit" in found.text
    assert found.cure == "raise the limit, or drive slower; fits leave j.velocity out"
    assert abs(found.evidence["limit"]) == pytest.approx(most)


def test_what_was_not_measured_does_not_count(make_axis):
    axis = make_axis()
    most = 0.5 * float(np.max(np.abs(axis.velocity)))
    velocity = np.where(np.arange(axis.time.size) % 5 == 0, np.nan, np.clip(axis.velocity, -most, most))
    assert _limit(axis, velocity) is not None
    assert _limit(axis, np.full(axis.time.size, np.nan)) is None
