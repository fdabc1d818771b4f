"""The recorder writes what is of its own graph, and keeps no bag of another's."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop_nodes.codec import JointSample, encode_joint_state, peek_stamp

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_environment")]

MODES = ("lockstep", "realtime")


class Sent:
    """A stream of measurements that have come already."""

    heard = True

    def __init__(self, first, last):
        self._left = list(range(first, last + 1))

    def take(self):
        while self._left:
            stamp = self._left.pop(0)
            sample = JointSample(stamp, ("motor",), (0.0,), (0.0,))
            yield encode_joint_state(sample), {"received_timestamp": stamp, "publication_sequence_number": stamp}


def hears(node, first, last):
    node._streams["joint_states"] = Sent(first, last)
    node._collect()


@pytest.mark.parametrize("mode", MODES)
def test_what_came_before_it_knew_its_graph_is_written_then_in_order(bench, tmp_path, mode):
    from rosbags.highlevel import AnyReader

    one = bench("recorder", bag=str(tmp_path / "bag"), mode=mode, sample_time=0.001, peers="[bench]")
    hears(one.node, 1, 3)
    assert one.node.start.waiting
    one.node.start.ready = True
    hears(one.node, 4, 5)
    one.node.close()
    with AnyReader([tmp_path / "bag"]) as reader:
        assert [peek_stamp(bytes(data)) for _, _, data in reader.messages()] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("mode", MODES)
def test_of_a_graph_that_it_never_was_a_part_of_nothing_is_kept(bench, tmp_path, mode):
    one = bench("recorder", bag=str(tmp_path / "bag"), mode=mode, sample_time=0.001, peers="[bench]")
    hears(one.node, 1, 3)
    one.node.close()
    assert not (tmp_path / "bag").exists()


def test_of_a_graph_that_turned_out_to_be_another_nothing_is_kept(bench, tmp_path):
    from idloop_nodes.codec import encode_header

    one = bench("recorder", bag=str(tmp_path / "bag"), mode="realtime", sample_time=0.001)
    namesake = one.talk("progress")
    one.matched(namesake)
    one.until(lambda: one.node.start.ready and one.node.start.duplicate.announcements == 1)
    hears(one.node, 1, 3)
    one.until(lambda: one.node._writer.count == 3)
    namesake.publish(encode_header(0, "recorder/ready"))
    one.until(lambda: one.node.broken is not None)
    one.node.close()
    assert not (tmp_path / "bag").exists()


def test_what_waits_is_limited_and_counted(bench, tmp_path):
    bag = str(tmp_path / "bag")
    one = bench("recorder", bag=bag, mode="realtime", sample_time=0.001, peers="[bench]", queue_limit=1000)
    hears(one.node, 1, 1000)
    hears(one.node, 1001, 1010)
    assert one.node._overflow == 10
    one.node.start.ready = True
    one.node.poll()
    one.until(lambda: one.node._writer.count == 1000)
