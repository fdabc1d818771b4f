"""Bursts come just after a sample where the stamps tell when that is, and evenly where they do not."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.timing import ARRIVED, LITTLE_SHARE, LONGEST, MOST_SHARE, WEIGH_PERIOD, Bursts


def test_the_first_burst_is_due_at_once_and_the_next_after_its_time():
    bursts = Bursts(0.04)
    assert bursts.due(100.0)
    bursts.plan(100.0)
    assert not bursts.due(100.03)
    assert bursts.wait == pytest.approx(0.01)
    assert bursts.due(100.04)


@pytest.mark.parametrize("age", [0.0, ARRIVED, 0.001, 0.0024])
def test_a_burst_comes_just_after_a_sample(age):
    bursts = Bursts(0.003, 0.001)
    bursts.plan(100.0, age)
    assert bursts.wait == pytest.approx(0.003 + ARRIVED - age)


def test_samples_that_are_rare_are_taken_one_by_one():
    bursts = Bursts(0.003, 0.01)
    bursts.plan(100.0, 0.0)
    assert bursts.wait == pytest.approx(0.01 + ARRIVED)


@pytest.mark.parametrize("age", [-0.5, 1.5, 1e9])
def test_a_clock_that_is_not_ours_gives_even_bursts(age):
    bursts = Bursts(0.003, 0.001)
    bursts.plan(100.0, age)
    assert bursts.wait == pytest.approx(0.003)


def test_samples_that_stay_away_are_looked_for_evenly():
    bursts = Bursts(0.003, 0.001)
    bursts.plan(100.0, 0.0004)
    bursts.plan(100.003, None)
    assert bursts.wait == pytest.approx(0.003)


def test_what_came_during_a_long_burst_is_taken_at_once():
    bursts = Bursts(0.003, 0.001)
    bursts.plan(100.0, 0.02)
    assert bursts.due(100.0)


def length_after(bursts, share, count, start):
    """Time between even bursts when each weighing finds this share of a core."""
    for index in range(count + 1):
        bursts.weigh(start + index * WEIGH_PERIOD * 1.01, share * index * WEIGH_PERIOD * 1.01)
    bursts.plan(0.0)
    return bursts.wait


def test_dear_bursts_are_drawn_apart_and_cheap_ones_together_again():
    bursts = Bursts(0.003, 0.001)
    assert length_after(bursts, 0.5 * (LITTLE_SHARE + MOST_SHARE), 5, 0.0) == pytest.approx(0.003)
    assert length_after(Bursts(0.003, 0.001), MOST_SHARE + 0.1, 3, 0.0) == pytest.approx(0.006)
    assert length_after(Bursts(0.003, 0.001), MOST_SHARE + 0.1, 50, 0.0) == pytest.approx(LONGEST)
    dear = Bursts(0.003, 0.001)
    length_after(dear, MOST_SHARE + 0.1, 4, 0.0)
    dear.plan(0.0, 0.0)
    assert dear.wait == pytest.approx(0.007 + ARRIVED)
    spent = (MOST_SHARE + 0.1) * 4 * WEIGH_PERIOD * 1.01
    for index in range(1, 20):
        dear.weigh((4 + index) * WEIGH_PERIOD * 1.01, spent)
    dear.plan(0.0)
    assert dear.wait == pytest.approx(0.003)
