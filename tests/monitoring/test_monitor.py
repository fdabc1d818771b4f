"""A motor that is watched: healthy, worn, warm, and standing still."""

from __future__ import annotations

import pytest

from idloop.monitoring import ALARM, CANNOT_TELL, QUIET, Monitor

LEVEL = "coulomb_friction@motor.level"
GROWTH = 0.12


def test_a_healthy_machine_is_quiet(baseline, run):
    monitor = Monitor(baseline)
    trace = monitor.follow(run(240.0, 21))
    (state,) = monitor.states()
    assert state.state == QUIET
    assert not trace.alarms
    assert state.growth.low < 0.0 < state.growth.high
    assert state.parameter == LEVEL
    assert state.delay == pytest.approx(state.reference_delay, rel=0.3)


def test_a_worn_machine_alarms_after_about_the_promised_delay(baseline, run):
    monitor = Monitor(baseline)
    monitor.follow(run(60.0, 22))
    monitor.begin()
    trace = monitor.follow(run(240.0, 23, GROWTH))
    (state,) = monitor.states()
    assert state.state == ALARM
    block, which, alarm = trace.alarms[0]
    assert which == 0
    assert (block + 1) * baseline.block < 3.0 * baseline.delay(0) + baseline.settling + baseline.block
    assert state.growth.low < GROWTH < state.growth.high
    assert alarm.growth.low < state.growth.value < alarm.growth.high
    # What has grown stays, and alarms again.
    assert len(trace.alarms) > 3


def test_a_warm_machine_is_no_worn_one(baseline, run):
    monitor = Monitor(baseline)
    monitor.follow(run(240.0, 31, viscous=0.8))
    assert monitor.states()[0].state == QUIET


def test_a_machine_at_rest_cannot_tell(baseline, run):
    monitor = Monitor(baseline)
    trace = monitor.follow(run(60.0, 24, GROWTH, name="step", amplitude=3.0, start=59.0).cut(None, 12.0))
    (state,) = monitor.states()
    assert state.state == CANNOT_TELL
    assert "no block is informative" in state.why
    assert (state.telling, state.sum, state.growth) == (0, 0.0, None)
    assert not trace.alarms


def test_too_little_motion_cannot_tell_and_says_how_much_would(baseline, run):
    monitor = Monitor(baseline)
    monitor.follow(run(9.0, 25))
    (state,) = monitor.states()
    assert state.state == CANNOT_TELL
    assert "too little data" in state.why


def test_stretches_that_overlap_are_counted_once(baseline, run):
    record = run(100.0, 26, GROWTH)
    whole, parts = Monitor(baseline), Monitor(baseline)
    whole.follow(record)
    for start in (0.0, 20.0, 40.0, 60.0, 80.0):
        parts.follow(record.cut(max(start - baseline.settling - baseline.block, 0.0), start + 20.0))
    assert parts.sums[0].blocks == whole.sums[0].blocks
    assert [a.block for a in parts.sums[0].alarms] == [a.block for a in whole.sums[0].alarms]
