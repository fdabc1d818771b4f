"""Positions that run together, with and without slack between them."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.inspection.coupled import has_slack, transmission

T = np.arange(2000) * 0.01
PLACE = 3.0 * np.sin(T) + np.sin(3.1 * T)
SLACK = 0.05 * np.sign(np.cos(T))


@pytest.mark.parametrize("ratio", [1.0, 0.02, -3.0])
def test_a_gear_has_its_ratio(ratio):
    assert transmission(PLACE, ratio * (PLACE + SLACK) + 0.4) == pytest.approx(ratio, rel=0.02)


def test_other_motions_have_no_ratio():
    assert transmission(PLACE, np.cos(0.7 * T)) == 0.0
    assert transmission(PLACE, np.full(T.size, 2.0)) == 0.0
    assert transmission(PLACE, PLACE[:-1]) == 0.0


def test_slack_is_more_than_the_steps_of_the_sensors():
    coarse = np.round(PLACE / 0.01) * 0.01
    assert has_slack(coarse, np.round((PLACE + SLACK) / 0.02) * 0.02)
    # The same sensor in another unit, and a coarser one on a rigid shaft.
    assert not has_slack(coarse, np.degrees(coarse))
    assert not has_slack(coarse, np.round(PLACE / 0.02) * 0.02)


def test_what_was_not_measured_does_not_count():
    holed = np.where(np.arange(T.size) % 7 == 0, np.nan, PLACE + SLACK)
    assert transmission(PLACE, holed) == pytest.approx(1.0, rel=0.02)
    assert has_slack(PLACE, holed)
