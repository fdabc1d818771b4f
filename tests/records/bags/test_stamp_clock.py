"""Simulated time is told from dates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.records.bags.stamp_clock import share_no_clock, stamp_clock
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


def test_dates_share_a_clock_whatever_the_delay() -> None:
    measured = states(RECEIVE - 3_000_000)
    clock = stamp_clock(measured)
    assert clock.source == "date"
    assert clock.offset == pytest.approx(-0.003)
    assert not share_no_clock(replace(states(RECEIVE), stamped=False), measured)
