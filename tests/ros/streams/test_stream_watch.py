"""When a stream is silent, and which stamps say that a clock was set: both sides of every bound."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.streams.stream_watch import JUMP_NS, Arrival, StreamWatch

MS = 1_000_000
SECOND = 1000 * MS
TIMEOUT = 40 * MS
START = 5 * SECOND


def watch():
    one = StreamWatch(TIMEOUT)
    assert one.update(MS, START) is Arrival.FRESH
    return one


def test_a_new_stream_is_silent_and_unheard():
    one = StreamWatch(TIMEOUT)
    assert JUMP_NS == SECOND
    assert one.silent(0)
    assert not one.begun
    assert (one.jumps, one.stale) == (0, 0)
    one.update(0, 0)
    assert one.begun


@pytest.mark.parametrize(("late", "silent"), [(TIMEOUT, False), (TIMEOUT + 1, True)])
def test_silence_begins_after_the_timeout(late, silent):
    assert watch().silent(MS + late) is silent


@pytest.mark.parametrize(
    ("step", "arrival"),
    [
        (1, Arrival.FRESH),
        (JUMP_NS - 1, Arrival.FRESH),
        (JUMP_NS, Arrival.JUMP),
        (0, Arrival.STALE),
        (-1, Arrival.STALE),
        (1 - JUMP_NS, Arrival.STALE),
        (-JUMP_NS, Arrival.JUMP),
    ],
)
def test_how_far_a_stamp_may_be_from_the_last(step, arrival):
    one = watch()
    assert one.update(2 * MS, START + step) is arrival
    assert (one.jumps, one.stale) == (arrival is Arrival.JUMP, arrival is Arrival.STALE)


def test_what_is_stale_is_no_sign_of_life():
    one = watch()
    one.update(20 * MS, START)
    assert one.silent(MS + TIMEOUT + 1)
    one.update(20 * MS, START + 1)
    assert not one.silent(MS + TIMEOUT + 1)


@pytest.mark.parametrize("step", [-JUMP_NS, -1, 1, JUMP_NS])
def test_after_a_silence_any_other_stamp_is_a_new_beginning(step):
    one = watch()
    later = MS + TIMEOUT + 1
    assert one.update(later, START + step) is Arrival.FRESH
    assert not one.silent(later + TIMEOUT)
    assert one.update(later + MS, START + step) is Arrival.STALE, "compared with the new one"


def test_the_same_stamp_is_stale_after_a_silence_too():
    assert watch().update(MS + TIMEOUT + 1, START) is Arrival.STALE


def test_a_message_without_a_stamp_is_fresh_and_leaves_the_last_stamp():
    one = watch()
    assert one.update(2 * MS, 0) is Arrival.FRESH
    assert one.update(3 * MS, START) is Arrival.STALE
    assert one.update(4 * MS, START + MS) is Arrival.FRESH


def test_a_stream_without_stamps_never_jumps():
    one = StreamWatch(TIMEOUT)
    assert [one.update(k * MS, 0) for k in range(1, 4)] == [Arrival.FRESH] * 3
    assert one.update(4 * MS, START) is Arrival.FRESH, "the first stamp is compared with none"
