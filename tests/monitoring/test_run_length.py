"""Promised run lengths against counted ones, and what a short reference costs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import IdloopError
from idloop.monitoring.run_length import (
    Evidence,
    detection_delay,
    false_alarm_rate,
    find_threshold,
    needed_reference,
    run_length,
)


def count(threshold, drift, variance, walks=4000, steps=2000):
    """Mean blocks between alarms of many CUSUMs that start again at each alarm."""
    rng = np.random.default_rng(1)
    total, alarms = np.zeros(walks), 0
    for _ in range(steps):
        total = np.maximum(total + rng.normal(drift, np.sqrt(variance), walks), 0.0)
        alarms += int(np.sum(total > threshold))
        total[total > threshold] = 0.0
    return walks * steps / alarms


@pytest.mark.parametrize("ratio", (0.05, 0.3, 1.0))
def test_it_runs_as_long_as_promised(ratio):
    threshold = find_threshold(500.0, Evidence(ratio, 1.0, 1e9))
    assert count(threshold, -ratio, 2.0 * ratio) == pytest.approx(500.0, rel=0.15)
    assert count(threshold, ratio, 2.0 * ratio) == pytest.approx(run_length(threshold, ratio, 2.0 * ratio), rel=0.15)


def test_a_reference_of_finite_length_is_paid_for_with_a_higher_threshold():
    exact = find_threshold(1e5, Evidence(0.5, 1.0, 1e9))
    short = find_threshold(1e5, Evidence(0.5, 1.0, 200.0))
    assert short > exact + 0.5


def test_the_promise_holds_over_many_references():
    evidence = Evidence(0.5, 1.0, 60.0)
    threshold = find_threshold(200.0, evidence)
    rng = np.random.default_rng(2)
    walks, steps = 4000, 1000
    # Each walk has a reference of its own, which took offset and variance from sixty normal numbers.
    seen = rng.normal(size=(walks, 60))
    offset, variance_ratio = np.mean(seen, axis=1), np.var(seen, axis=1, ddof=1)
    total, alarms = np.zeros(walks), 0
    for _ in range(steps):
        z = rng.normal(size=walks) - offset
        total = np.maximum(total + (z - 0.5) / variance_ratio, 0.0)
        alarms += int(np.sum(total > threshold))
        total[total > threshold] = 0.0
    assert walks * steps / alarms == pytest.approx(200.0, rel=0.35)


def test_a_reference_that_is_too_short_is_refused_and_the_needed_length_is_known():
    evidence = Evidence(0.5, 1.0, 20.0)
    with pytest.raises(IdloopError, match="too short"):
        find_threshold(1e6, evidence)
    factor = needed_reference(1e6, evidence)
    assert 1.0 < factor < 20.0
    find_threshold(1e6, Evidence(0.5, 1.0, 20.0 * factor))


@given(ratio=st.floats(1e-3, 50.0), blocks=st.floats(50.0, 1e7), informative=st.floats(0.05, 1.0))
def test_the_threshold_gives_the_rate(ratio, blocks, informative):
    evidence = Evidence(ratio, informative, 1e6)
    threshold = find_threshold(blocks, evidence)
    rate = false_alarm_rate(threshold, evidence)
    assert rate <= 1.0 / blocks
    if threshold > 3.1:  # above the least threshold it is no higher than it must be
        assert rate > 0.98 / blocks


@given(drift=st.floats(-2.0, 2.0), variance=st.floats(0.01, 4.0), threshold=st.floats(1.0, 30.0))
def test_a_higher_threshold_is_crossed_later_and_a_higher_drift_sooner(drift, variance, threshold):
    here = run_length(threshold, drift, variance)
    assert run_length(threshold + 1.0, drift, variance) >= here * (1 - 1e-6)
    assert run_length(threshold, drift + 0.1, variance) <= here * (1 + 1e-6)


def test_idle_blocks_only_cost_time():
    busy, idle = Evidence(0.5, 1.0, 1e4), Evidence(0.5, 0.25, 1e4)
    assert detection_delay(10.0, idle) == pytest.approx(4.0 * detection_delay(10.0, busy))
    assert false_alarm_rate(10.0, idle) == pytest.approx(0.25 * false_alarm_rate(10.0, busy))


def test_half_of_the_watched_growth_is_taken_for_none():
    evidence = Evidence(0.5, 1.0, 1e4)
    assert detection_delay(10.0, evidence, 0.5) == np.inf
    assert detection_delay(10.0, evidence, 2.0) < detection_delay(10.0, evidence, 1.0) < np.inf
