"""Whoever waits at the start says for whom, and gives up only on those who do not come."""

from __future__ import annotations

import itertools

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import IdloopError
from idloop_nodes.graph_start import NOTICE, RUNNING_PEER_FACTOR, StartBarrier

PEERS = ["controller", "plant", "estimator"]
SETS = st.sets(st.sampled_from([*PEERS, "plotter"]))


def test_who_does_not_appear_is_named_when_the_time_is_over():
    barrier = StartBarrier(PEERS, 30.0, born=5.0)
    assert barrier.notice(["plant"], PEERS[:2], [], 5.0 + NOTICE) == (
        "waits: estimator not there yet; controller there, not ready (a first start compiles)"
    )
    with pytest.raises(IdloopError, match=r"^estimator did not appear within 30 s"):
        barrier.notice(["plant"], PEERS[:2], [], 35.1)


def test_who_is_there_and_compiles_has_longer_but_not_for_ever():
    barrier = StartBarrier(PEERS, 30.0, born=0.0)
    assert barrier.notice(PEERS[:2], PEERS, [], 31.0).startswith("waits: estimator there")
    barrier.notice(PEERS[:2], PEERS, [], RUNNING_PEER_FACTOR * 30.0)
    with pytest.raises(IdloopError, match=r"gave up after 600 s .*estimator there, not ready"):
        barrier.notice(PEERS[:2], PEERS, [], RUNNING_PEER_FACTOR * 30.0 + 1.0)


def test_a_stream_that_is_not_connected_is_named_when_everybody_is_there():
    barrier = StartBarrier(PEERS, 30.0, born=0.0)
    assert barrier.notice(PEERS, PEERS, ["joint_states"], NOTICE) == (
        "waits: joint_states not connected with all who are there"
    )


@given(st.lists(st.tuples(SETS, SETS), max_size=8))
def test_nothing_is_said_twice_in_a_row_nor_before_its_time(looks):
    barrier = StartBarrier(PEERS, 1e9, born=0.0)
    assert not any(barrier.notice(ready, there, [], 0.9 * NOTICE) for ready, there in looks)
    said = [text for ready, there in looks if (text := barrier.notice(ready, there, [], NOTICE))]
    assert all(one != other for one, other in itertools.pairwise(said))
    assert all(any(name in text for name in PEERS) for text in said)
