"""The pieces that nodes are made of, without a node."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.progress import BackPressure
from idloop_nodes.streams.canonical_order import CanonicalOrder, rank_topics
from idloop_nodes.streams.held_stream import HeldStream
from idloop_nodes.streams.sample_store import SampleStore
from idloop_nodes.streams.sequence_check import SequenceCheck
from idloop_nodes.wiring import NODES, TOPICS, expected_publishers, expected_subscribers, subscriptions, told


@given(st.lists(st.tuples(st.integers(0, 50), st.floats(allow_nan=False)), min_size=1), st.integers(0, 60))
def test_held_stream_is_the_newest_value_not_after_the_question(items, when):
    ordered = sorted(dict(items).items())
    stream = HeldStream()
    for stamp, value in ordered:
        stream.push(stamp, (value,))
    wanted = [(stamp, (value,)) for stamp, value in ordered if stamp <= when]
    assert stream.covers(when) == (ordered[-1][0] >= when)
    assert stream.at(when) == (wanted[-1] if wanted else None)


def test_held_stream_takes_announced_values_back():
    stream = HeldStream()
    for stamp in (10, 20, 30):
        stream.push(stamp, (float(stamp),))
    stream.push(20, (0.0,))
    assert stream.at(40) == (20, (0.0,))
    assert stream.newest == 20


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


def test_back_pressure_waits_for_the_slowest_listener():
    gate = BackPressure(["a", "b"], window_ns=10)
    assert gate.open(10, start=0)
    assert not gate.open(11, start=0)
    gate.progress.hear(5, "a")
    assert not gate.open(11, start=0)
    gate.progress.hear(3, "b")
    assert gate.open(13, start=0)
    assert not gate.open(14, start=0)
    gate.progress.hear(3, "b/done")
    assert gate.missing() == ["a"]
    gate.progress.hear(3, "a/done")
    assert gate.finished()


def test_back_pressure_without_listeners_is_always_open():
    assert BackPressure([], 0).open(10**18, start=0)
    assert BackPressure([], 0).finished()


@given(st.lists(st.integers(1, 40), min_size=1, max_size=3000), st.integers(0, 500), st.integers(0, 2000))
def test_sample_store_gives_what_was_stored(steps, width, start):
    stamps = np.cumsum(steps)
    store = SampleStore(1)
    for stamp in stamps:
        store.append(int(stamp), (float(stamp),))
    got, rows = store.window(start, start + width)
    inside = stamps[(stamps >= start) & (stamps < start + width)]
    assert got.tolist() == inside.tolist() == rows[:, 0].tolist()


def test_sample_store_forgets_but_keeps_the_held_value():
    store = SampleStore(1)
    for stamp in range(0, 5000, 10):
        store.append(stamp, (float(stamp),))
        store.forget(stamp - 100)
    assert len(store) <= 12
    stamps, _ = store.window(4905, 4921, before=True)
    assert stamps.tolist() == [4900, 4910, 4920]


def test_sample_store_leaves_repeated_stamps_out():
    store = SampleStore(1)
    for stamp, value in ((1, 1.0), (1, 2.0), (0, 3.0), (2, 4.0)):
        store.append(stamp, (value,))
    assert store.window(0, 9)[1][:, 0].tolist() == [1.0, 4.0]


@given(st.lists(st.tuples(st.sampled_from(["append", "take_back", "forget"]), st.integers(0, 400)), max_size=60))
def test_sample_store_does_as_a_list_would(orders):
    store, plain = SampleStore(1), []
    for verb, stamp in orders:
        getattr(store, verb)(*((stamp, (float(stamp),)) if verb == "append" else (stamp,)))
        if verb == "append" and (not plain or stamp > plain[-1]):
            plain.append(stamp)
        elif verb == "take_back":
            plain = [one for one in plain if one < stamp]
        elif verb == "forget":
            plain = plain[max(0, sum(one < stamp for one in plain) - 1) :]
    assert len(store) == len(plain)
    assert store.window(0, 500)[0].tolist() == plain


def number(value, source=b"a"):
    return {"publication_sequence_number": value, "publisher_gid": {"data": source}}


def test_losses_are_counted_for_each_publisher():
    check = SequenceCheck(0)
    for information in (number(4), number(5), number(1, b"b"), number(8), number(2, b"b")):
        check.take(information, 0)
    assert check.lost == 2
    assert check.received == 5


def test_losses_without_numbers_are_counted_on_the_grid():
    check = SequenceCheck(10)
    for stamp in (0, 10, 40, 50):
        check.take({}, stamp)
    assert check.lost == 2


def test_the_wiring_is_closed():
    """Every stream that a node subscribes is published by another, else the start barrier would never open."""
    graph = ("excitation", "controller", "plant", "bridge", "recorder", "estimator")
    for kind in graph:
        for topic in subscriptions(kind, graph):
            assert expected_publishers(topic, graph) >= 1, topic
        for topic in NODES[kind].publishes:
            assert expected_subscribers(topic, graph) >= 1, topic


def test_behind_a_bridge_it_counts_what_the_machine_was_told():
    robot, simulated = (
        ("controller", "bridge", "recorder", "estimator"),
        ("controller", "plant", "recorder", "estimator"),
    )
    assert told("joint_command", robot) == "bridge/command"
    assert told("joint_command", simulated) == "joint_command"
    assert told("motor/command", robot) == "motor/command"
    # the recorder and the bridge hear the one, recorder and estimator the other
    assert (expected_subscribers("joint_command", robot), expected_subscribers("bridge/command", robot)) == (2, 2)
    assert expected_subscribers("joint_command", simulated) == 3
