"""Samples left out of a stream that is too fast."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.decimator import Decimator

SECOND = 1_000_000_000


@given(rate=st.integers(1, 20_000), jitter=st.lists(st.floats(-0.05, 0.05), min_size=50, max_size=50))
def test_a_stream_within_the_rate_loses_nothing(rate, jitter):
    decimator = Decimator(2000.0)
    period = SECOND / min(rate, 2000)
    assert all(decimator.passes(SECOND + round((k + early) * period)) for k, early in enumerate(jitter))
    assert decimator.left_out == 0


@given(times=st.integers(2, 20))
def test_of_a_faster_one_every_nth_passes(times):
    decimator = Decimator(2000.0)
    stamps = [SECOND + round(k * SECOND / 2000 / times) for k in range(200 * times)]
    passed = [stamp for stamp in stamps if decimator.passes(stamp)]
    assert 200 <= len(passed) <= 230
    assert len(passed) + decimator.left_out == len(stamps)
    assert len({round((b - a) / 1000) for a, b in pairwise(passed)}) == 1


def test_a_clock_that_is_set_back_does_not_silence_the_stream():
    decimator = Decimator(2000.0)
    assert decimator.passes(10 * SECOND)
    assert decimator.passes(5 * SECOND)
