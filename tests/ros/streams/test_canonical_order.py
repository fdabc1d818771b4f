"""An order of messages that does not depend on their arrival."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.streams.bag_writer import CanonicalOrder, rank_topics
from idloop_nodes.topics import TOPICS


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 3)), unique=True), st.randoms())
def test_canonical_order_forgets_the_order_of_arrival(messages, random):
    def order(items):
        sorter = CanonicalOrder()
        for stamp, rank in items:
            sorter.add(stamp, rank, bytes([stamp, rank]))
        return sorter.take()

    shuffled = list(messages)
    random.shuffle(shuffled)
    assert order(messages) == order(shuffled)
    assert [entry[:2] for entry in order(messages)] == sorted(messages)


def test_canonical_order_keeps_what_is_not_due():
    sorter = CanonicalOrder()
    for stamp in (5, 3, 4):
        sorter.add(stamp, 0, b"")
    assert [stamp for stamp, _, _ in sorter.take(until=5)] == [3, 4]
    assert len(sorter) == 1


def test_what_is_said_again_is_there_once():
    sorter = CanonicalOrder()
    for stamp, payload in ((1, b"a"), (2, b"b"), (2, b"b"), (3, b"b")):
        sorter.add(stamp, 0, payload)
    assert [one[0] for one in sorter.take(until=3)] == [1, 2]
    sorter.add(2, 0, b"b")
    sorter.add(3, 0, b"c")
    assert [one[0] for one in sorter.take()] == [3, 3]


def test_results_come_after_everything_of_their_stamp():
    ranks = rank_topics([*TOPICS])
    assert max(ranks[name] for name in ("reference", "joint_states", "estimator/residual")) < ranks["estimator/fit"]
