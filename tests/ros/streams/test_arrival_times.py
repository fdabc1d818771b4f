"""Log times keep a topic in order, and follow a clock that was set."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from hypothesis import given
from hypothesis import strategies as st

from idloop_nodes.codec import JointSample, encode_joint_state
from idloop_nodes.streams.stream_watch import JUMP_NS, ArrivalTimes


@given(st.lists(st.integers(0, JUMP_NS - 1), min_size=1))
def test_what_came_again_has_no_time_after_its_successors(received):
    times = ArrivalTimes()
    logged = [times.of("joint_states", one) for one in received]
    assert logged == sorted(logged)
    assert all(log >= one for log, one in zip(logged, received, strict=True))
    assert set(logged) <= set(received)


def test_a_clock_that_was_set_back_is_followed_and_topics_are_apart():
    times = ArrivalTimes()
    assert [times.of("a", one) for one in (10 * JUMP_NS, 3 * JUMP_NS, 3 * JUMP_NS + 1)] == [
        10 * JUMP_NS,
        3 * JUMP_NS,
        3 * JUMP_NS + 1,
    ]
    assert times.of("b", 5) == 5


class Sent:
    """A stream whose third message was lost at first: it was received after the others."""

    heard = True

    def __init__(self):
        self._left = [(1, 1001), (2, 1002), (3, 1009), (4, 1004), (5, 1005)]

    def take(self):
        while self._left:
            stamp, received = self._left.pop(0)
            sample = JointSample(stamp, ("motor",), (0.0,), (0.0,))
            yield encode_joint_state(sample), {"received_timestamp": received, "publication_sequence_number": stamp}


@pytest.mark.ros
@pytest.mark.usefixtures("ros_environment")
def test_a_recording_in_real_time_has_a_sample_that_was_sent_again_in_its_place(bench, tmp_path):
    from rosbags.highlevel import AnyReader

    from idloop_nodes.codec import peek_stamp

    one = bench("recorder", bag=str(tmp_path / "bag"), mode="realtime", sample_time=0.001)
    one.node._streams["joint_states"] = Sent()
    one.node._collect()
    one.node.close()
    with AnyReader([tmp_path / "bag"]) as reader:
        assert [peek_stamp(bytes(data)) for _, _, data in reader.messages()] == [1, 2, 3, 4, 5]
