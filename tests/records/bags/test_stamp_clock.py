"""Simulated time is told from dates, and receive times are carried over to the clock of the stamps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.records.bags.stamp_clock import on_clock_of, share_no_clock, stamp_clock
from idloop.records.bags.write import make_stream

RECEIVE = 1_700_000_000_000_000_000 + np.arange(400, dtype=np.int64) * 5_000_000


def states(stamps: np.ndarray):
    return make_stream("/joint_states", stamps, {"j": {"position": np.arange(stamps.size) * 1.0}}, RECEIVE)


@pytest.mark.parametrize(("speed", "start"), [(1.0, 12.0), (0.5, 0.0), (4.0, 3000.0)])
def test_simulated_time_beside_receive_time(speed: float, start: float) -> None:
    simulated = states(np.int64(start * 1e9) + ((RECEIVE - RECEIVE[0]) * speed).astype(np.int64))
    command = replace(states(RECEIVE), stamped=False)
    clock = stamp_clock(simulated)
    assert clock.source == "start"
    assert clock.speed == pytest.approx(speed)
    assert stamp_clock(command).source == "recorder"
    assert share_no_clock(command, simulated)
    between = RECEIVE[:-1] + 2_000_000
    expected = simulated.stamp_ns[0] + (between - RECEIVE[0]) * speed
    np.testing.assert_allclose(on_clock_of(between, simulated), expected, atol=500)


def test_dates_share_a_clock_whatever_the_delay() -> None:
    measured = states(RECEIVE - 3_000_000)
    clock = stamp_clock(measured)
    assert clock.source == "date"
    assert clock.offset == pytest.approx(-0.003)
    assert not share_no_clock(replace(states(RECEIVE), stamped=False), measured)


def test_times_beyond_the_ends_keep_the_offset_there() -> None:
    simulated = states(RECEIVE - RECEIVE[0] + 7)
    outside = np.array([RECEIVE[0] - 10**9, RECEIVE[-1] + 10**9])
    np.testing.assert_array_equal(on_clock_of(outside, simulated), outside - RECEIVE[0] + 7)
