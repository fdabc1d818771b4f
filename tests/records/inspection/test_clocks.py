"""Stamps are measured the same whatever their origin, and two clocks are told from one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.records.bags.write import make_stream
from idloop.records.inspection.clocks import (
    compare_clocks,
    share_no_clock,
    stamp_findings,
    stamp_statistics,
    while_measured,
)

MS = 1_000_000


@given(
    start=st.integers(0, 2 * 10**18),
    period=st.integers(1, 100),
    count=st.integers(10, 60),
    lost=st.sets(st.integers(1, 8)),
)
def test_losses_on_a_grid_are_counted_exactly(start, period, count, lost):
    grid = np.delete(np.arange(count + 20), sorted(lost))
    statistics = stamp_statistics(start + grid * period * MS)
    assert statistics.lost == len(lost)
    assert statistics.period == pytest.approx(period * 1e-3, rel=1e-12)
    assert statistics.count == grid.size


@given(shuffled=st.permutations(list(range(3))))
def test_order_of_reception_within_a_run_does_not_count(shuffled):
    stamps = np.arange(60) * MS
    stamps[30:33] = stamps[30 + np.array(shuffled)]
    statistics = stamp_statistics(stamps)
    assert statistics.lost == statistics.duplicates == 0
    assert not statistics.resets
    assert (statistics.reordered > 0) == (shuffled != [0, 1, 2])


def test_resets_are_found_where_they_are():
    stamps = np.concatenate([np.arange(50), np.arange(20), np.arange(30)]) * MS
    statistics = stamp_statistics(stamps)
    assert statistics.resets == (50, 70)
    assert statistics.largest_step_back == pytest.approx(0.049)
    assert statistics.lost == 0
    assert [finding.kind for finding in stamp_findings("x", statistics)] == ["clock_reset"]


def test_irregular_stamps_have_no_losses():
    rng = np.random.default_rng(0)
    stamps = np.cumsum(rng.integers(1, 30, size=500)) * MS
    statistics = stamp_statistics(stamps)
    assert not statistics.regular
    assert statistics.lost == 0
    assert "jitter" in {finding.kind for finding in stamp_findings("x", statistics)}


@pytest.mark.parametrize("stamps", [[], [5], [5, 5]])
def test_too_few_stamps_have_no_rate(stamps):
    statistics = stamp_statistics(np.array(stamps, dtype=np.int64))
    assert np.isnan(statistics.rate)
    assert statistics.count == len(stamps)


@pytest.mark.parametrize("speed", [0.1, 1.0, 30.0])
@pytest.mark.parametrize("drift", [0.0, 1e-3])
def test_drift_is_measured_at_any_speed_of_simulation(speed, drift):
    receive = 10**18 + np.arange(30_000) * MS
    stamp = (np.arange(30_000) * MS * speed).astype(np.int64)
    other = (np.arange(30_000) * MS * speed * (1 + drift)).astype(np.int64)
    clocks = compare_clocks(*(make_stream("/joint_states", one, {}, receive) for one in (other, stamp)))
    assert clocks.drift == pytest.approx(drift, abs=1e-6, rel=0.02)
    assert clocks.overlap > 0


@given(shift=st.integers(0, 9), lost=st.sets(st.integers(1, 8)))
def test_what_a_controller_sends_before_and_after_a_run_is_no_loss(shift, lost):
    run = np.arange(100) * 10 * MS
    command = np.delete(run, sorted(lost))
    idle = np.concatenate([np.arange(-20, -1), np.arange(101, 120)]) * 10 * MS + shift * MS
    sent = np.sort(np.concatenate([command, idle]))
    counted = stamp_statistics(while_measured(sent, [run + 1, run[::2]]))
    assert counted.lost == len(lost)


def test_a_command_beside_nothing_measured_counts_whole():
    command = np.arange(10) * MS
    for measured in ([], [np.zeros(0, np.int64)], [command + 10**12]):
        assert while_measured(command, measured) is command


RECEIVE = 1_700_000_000_000_000_000 + np.arange(400, dtype=np.int64) * 5_000_000


def states(stamps):
    return make_stream("/joint_states", stamps, {"j": {"position": np.arange(stamps.size) * 1.0}}, RECEIVE)


@pytest.mark.parametrize(("speed", "start"), [(1.0, 12.0), (0.5, 0.0), (4.0, 3000.0)])
def test_simulated_time_beside_receive_time(speed, start):
    simulated = states(np.int64(start * 1e9) + ((RECEIVE - RECEIVE[0]) * speed).astype(np.int64))
    command = replace(states(RECEIVE), stamped=False)
    assert share_no_clock(command, simulated)
    assert share_no_clock(simulated, command)
    assert not share_no_clock(simulated, simulated)


def test_dates_share_a_clock_whatever_the_delay():
    assert not share_no_clock(replace(states(RECEIVE), stamped=False), states(RECEIVE - 3_000_000))
