"""Page's sum: starts again below 0, alarms above its threshold, and is not fooled by idle blocks or a knock."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.monitoring.baseline import ReferenceStatistics
from idloop.monitoring.block_scores import EfficientScore
from idloop.monitoring.monitor import Cusum
from idloop.monitoring.run_length import Evidence
from idloop.monitoring.watch import Watch

INFORMATION = 4.0


def normal(growth=1.0, threshold=8.0, offset=0.0, variance_ratio=1.0, sensitivity=1.0):
    watch = Watch("friction", 5.0, growth, "N")
    ratio = (sensitivity * growth) ** 2 * INFORMATION / (2.0 * variance_ratio)
    return ReferenceStatistics(
        watch, offset, 0.01, variance_ratio, INFORMATION, Evidence(ratio, 1.0, 1e4), threshold, sensitivity=sensitivity
    )


def blocks(count, change, seed=0, information=INFORMATION, variance_ratio=1.0):
    noise = np.random.default_rng(seed).normal(0.0, np.sqrt(variance_ratio * information), count)
    return np.arange(count), EfficientScore(change * information + noise, np.full(count, information))


def test_a_growth_alarms_and_its_onset_is_found():
    index, healthy = blocks(50, 0.0, 1)
    _, worn = blocks(20, 1.0, 2)
    sums = Cusum()
    assert max(sums.take(normal(), index, healthy)) <= 8.0
    assert not sums.alarms
    sums.take(normal(), index[:20] + 50, worn)
    assert 50 <= sums.alarms[0].block < 65
    assert 45 <= sums.alarms[0].onset <= sums.alarms[0].block
    assert sums.alarms[0].growth.low < 1.0 < sums.alarms[0].growth.high


def test_a_fall_is_noticed_where_a_fall_is_watched():
    index, falling = blocks(30, -1.0)
    up, down = Cusum(), Cusum()
    up.take(normal(), index, falling)
    down.take(normal(growth=-1.0), index, falling)
    assert not up.alarms
    assert down.alarms
    assert down.growth(normal(growth=-1.0)).value == pytest.approx(-1.0, abs=0.5)


def test_what_the_reference_is_off_by_is_no_growth():
    index, shifted = blocks(200, 1.0)
    sums = Cusum()
    sums.take(normal(offset=1.0), index, shifted)
    assert not sums.alarms


def test_what_shows_only_in_part_is_told_in_full():
    index, faint = blocks(400, 0.5, 5)
    sums = Cusum()
    sums.take(normal(sensitivity=0.5), index, faint)
    assert sums.alarms
    growth = sums.growth(normal(sensitivity=0.5))
    assert growth.low < 1.0 < growth.high


@given(share=st.floats(0.0, 0.015), size=st.floats(-1e3, 1e3))
def test_blocks_that_tell_nothing_add_nothing(share, size):
    index = np.arange(20)
    sums = Cusum()
    sums.take(normal(), index, EfficientScore(np.full(20, size), np.full(20, share * INFORMATION)))
    assert (sums.sum, sums.informative, sums.blocks, sums.alarms) == (0.0, 0, 20, [])
    assert sums.growth(normal()) is None


@given(size=st.floats(10.0, 1e9))
def test_one_knock_is_no_wear(size):
    index, healthy = blocks(20, 0.0, 3)
    healthy.gradient[5] = size
    sums = Cusum()
    sums.take(normal(), index[:6], EfficientScore(healthy.gradient[:6], healthy.information[:6]))
    assert not sums.alarms
    assert sums.sum <= 8.0


@given(cut=st.integers(0, 40), seed=st.integers(0, 500), change=st.floats(-1.0, 2.0))
def test_it_does_not_matter_how_the_blocks_arrive(cut, seed, change):
    index, score = blocks(40, change, seed)
    whole, parts = Cusum(), Cusum()
    sums = whole.take(normal(), index, score)
    got = []
    for part in (slice(0, cut), slice(cut, 40)):
        got += parts.take(normal(), index[part], EfficientScore(score.gradient[part], score.information[part]))
    assert got == sums
    assert parts == whole
    assert all(value >= 0.0 for value in got)


def test_without_a_threshold_it_never_alarms():
    index, worn = blocks(100, 5.0)
    sums = Cusum()
    sums.take(normal(threshold=np.inf), index, worn)
    assert not sums.alarms


def test_the_newest_growth_forgets_what_was_before():
    index, healthy = blocks(200, 0.0, 1)
    sums = Cusum()
    sums.take(normal(), index, healthy)
    sums.take(normal(), index + 200, blocks(200, 2.0, 2)[1])
    growth = sums.growth(normal())
    assert growth.low < 2.0 < growth.high
    assert growth.high - growth.low < 1.0
