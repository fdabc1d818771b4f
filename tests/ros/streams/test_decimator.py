"""Samples left out of a stream that is too fast."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.streams.rates import BURST, Decimator

SECOND = 1_000_000_000


@given(rate=st.integers(1, 2000), jitter=st.lists(st.floats(-3.0, 3.0), min_size=50, max_size=50))
def test_a_stream_within_the_rate_loses_nothing_however_its_stamps_vary(rate, jitter):
    decimator = Decimator(2000.0)
    period = SECOND / rate
    stamps = sorted(SECOND + round((10 + k + early) * period) for k, early in enumerate(jitter))
    assert all(decimator.passes(stamp) for stamp in stamps)
    assert decimator.left_out == 0


@given(times=st.integers(2, 20))
def test_of_a_faster_one_every_nth_passes(times):
    decimator = Decimator(2000.0)
    stamps = [SECOND + round(k * SECOND / 2000 / times) for k in range(400 * times)]
    passed = [stamp for stamp in stamps if decimator.passes(stamp)]
    assert 400 <= len(passed) <= 400 + BURST
    assert len(passed) + decimator.left_out == len(stamps)
    steps = [round((b - a) * 2000 * times / SECOND) for a, b in pairwise(passed[2 * BURST :])]
    assert set(steps) <= {times - 1, times, times + 1}
    assert sum(steps) == times * len(steps) or abs(sum(steps) / len(steps) - times) < 0.01 * times


def test_a_clock_that_is_set_back_does_not_silence_the_stream():
    decimator = Decimator(2000.0)
    for _ in range(3 * BURST):
        decimator.passes(10 * SECOND)
    assert not decimator.passes(10 * SECOND)
    assert decimator.passes(5 * SECOND)
