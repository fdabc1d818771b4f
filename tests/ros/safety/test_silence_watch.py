"""When a guardian speaks for its bridge, in simulated time."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.safety.guardian_link import AFTER_END_NS, SilenceWatch

MS = 1_000_000
SILENCE = 30 * MS


def test_without_a_bridge_it_says_nothing():
    watch = SilenceWatch(SILENCE)
    assert AFTER_END_NS == 500 * MS
    assert (watch.intervening, watch.interventions, watch.longest_ns) == (False, 0, 0)
    assert watch.tick(0) == b""
    assert watch.tick(10_000 * MS) == b""


@given(late=st.integers(1, 10**12))
def test_a_silent_bridge_is_spoken_for_until_it_speaks(late):
    watch = SilenceWatch(SILENCE)
    watch.beat(0, b"zero")
    assert watch.tick(SILENCE) == b""
    assert watch.tick(SILENCE + late) == b"zero"
    assert watch.intervening
    watch.beat(SILENCE + late + MS, b"zero")
    assert watch.tick(SILENCE + late + 2 * MS) == b""
    assert watch.interventions == 1
    assert watch.longest_ns == SILENCE + late + MS


def test_a_bridge_that_has_gone_is_spoken_for_at_once_and_for_a_while():
    watch = SilenceWatch(SILENCE)
    watch.beat(0, b"zero")
    watch.gone(MS)
    assert watch.tick(MS) == b"zero"
    assert watch.tick(MS + AFTER_END_NS) == b"zero"
    assert watch.tick(MS + AFTER_END_NS + 1) == b""
    assert watch.interventions == 1


@pytest.mark.parametrize("end", ["silence", "gone"])
def test_a_bridge_whose_motor_is_not_its_own_is_not_spoken_for(end):
    watch = SilenceWatch(SILENCE)
    watch.beat(0, b"zero")
    watch.beat(MS, b"")
    if end == "gone":
        watch.gone(2 * MS)
    assert watch.tick(100 * MS) == b""
    assert watch.interventions == 0


def test_the_longest_silence_is_that_between_two_beats():
    watch = SilenceWatch(SILENCE)
    for now in (100, 105, 125, 130):
        watch.beat(now * MS, b"zero")
    assert watch.longest_ns == 20 * MS


def test_the_newest_neutral_message_counts():
    watch = SilenceWatch(SILENCE)
    watch.beat(0, b"at 1 rad")
    watch.beat(MS, b"at 2 rad")
    assert watch.tick(100 * MS) == b"at 2 rad"


@given(
    st.lists(st.tuples(st.integers(0, 60), st.sampled_from(["beat", "empty", "gone", "tick"])), min_size=1, max_size=60)
)
def test_what_is_sent_is_the_newest_message_of_a_bridge_that_is_silent_or_gone(events):
    """Against a slow model that looks through the whole past."""
    watch, now, past = SilenceWatch(SILENCE), 0, []
    for wait, event in events:
        now += wait * MS
        past.append((now, event))
        if event == "gone":
            watch.gone(now)
        elif event != "tick":
            watch.beat(now, b"zero" if event == "beat" else b"")
        spoken = [(at, what) for at, what in past if what != "tick"]
        expected = b""
        if spoken:
            begin, what = spoken[-1]
            beats = [what for _, what in spoken if what != "gone"]
            neutral = b"zero" if beats and beats[-1] == "beat" else b""
            due = now - begin <= AFTER_END_NS if what == "gone" else now - begin > SILENCE
            expected = neutral if due else b""
        assert watch.tick(now) == expected
