"""How a motion under a constant command begins."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.inspection.motion import beginning

RANDOM = np.random.default_rng(2)
TIME = np.arange(1, 301) * 0.01
SPEED = 1.0 - np.exp(-TIME / 0.3)
ANGLE = TIME - 0.3 * SPEED


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_step_from_rest(noise, sign):
    for value, velocity in ((SPEED, True), (ANGLE, False)):
        measured = sign * value + noise * RANDOM.normal(size=TIME.size)
        assert beginning(TIME, measured, velocity=velocity)[0] == "from rest"


def test_counts_of_an_encoder_and_missing_samples_do_not_matter():
    counts = 0.02 * np.floor(ANGLE / 0.02)
    counts[::7] = np.nan
    assert beginning(TIME, counts, velocity=False)[0] == "from rest"


def test_an_axis_that_moves_already_and_one_that_sets_off_later():
    for value, velocity in ((SPEED, True), (ANGLE, False)):
        assert beginning(TIME[150:], value[150:], velocity=velocity)[0] == "moving"
        late = np.concatenate([np.zeros(100), value])
        how, off = beginning(np.arange(1, 401) * 0.01, late, velocity=velocity)
        assert how == "late"
        assert off == pytest.approx(1.05, abs=0.06)


def test_what_stands_still_turns_round_or_is_too_coarse_tells_nothing():
    assert beginning(TIME, 1.0 - np.cos(6.0 * TIME), velocity=False)[0] == "unseen"
    for value, velocity in ((0.01 * RANDOM.normal(size=300), False), (np.ones(300), True), (np.round(ANGLE), False)):
        assert beginning(TIME, value, velocity=velocity)[0] == "unseen"
    assert beginning(TIME[:10], SPEED[:10], velocity=True)[0] == "unseen"
