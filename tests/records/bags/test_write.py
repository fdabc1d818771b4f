"""Bags are written once, as mcap, with the topics a graph would have recorded."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records import make_stream, read_streams, write_bag
from idloop.records.bags.stream import JointStream


def test_an_existing_bag_is_never_overwritten(bag, record):
    before = next(bag.glob("*.mcap")).read_bytes()
    with pytest.raises(InputError, match="not overwritten"):
        write_bag(bag, record)
    assert next(bag.glob("*.mcap")).read_bytes() == before


def test_topics_and_storage(bag):
    assert set(read_streams(bag)) == {"/joint_command", "/joint_states", "/reference", "/excitation"}
    assert [file.suffix for file in sorted(bag.iterdir())] == [".mcap", ".yaml"]


def test_what_is_measured_comes_before_what_it_causes(tmp_path, write_messages):
    from rosbags.rosbag2 import Reader

    stamps = 10**9 + np.arange(3)
    streams = [
        make_stream(topic, stamps, {"a": {"effort": np.arange(3.0)}})
        for topic in ("joint_command", "joint_states", "reference")
    ]
    with Reader(write_bag(tmp_path / "bag", streams)) as reader:
        order = [connection.topic for connection, _, _ in reader.messages()]
    assert order == ["/reference", "/joint_states", "/joint_command"] * 3


def test_nothing_to_write_and_foreign_types_are_refused(tmp_path):
    with pytest.raises(InputError, match="nothing to write"):
        write_bag(tmp_path / "bag", [])
    one = np.ones(1, dtype=np.int64)
    number = JointStream(
        "u", one, one, ("0",), np.ones((1, 1)), np.ones((1, 1)), np.ones((1, 1)), "std_msgs/msg/Float64"
    )
    with pytest.raises(InputError, match="only sensor_msgs"):
        write_bag(tmp_path / "bag", [number])
    with pytest.raises(InputError, match="storage"):
        write_bag(tmp_path / "bag", [make_stream("u", one, {"a": {}})], storage="rosbag1")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_bag(tmp_path / "file" / "bag", [make_stream("u", one, {"a": {}})])


def test_equal_content_gives_equal_files(tmp_path, record):
    first, second = (write_bag(tmp_path / name / "bag", record) for name in "ab")
    assert next(first.glob("*.mcap")).read_bytes() == next(second.glob("*.mcap")).read_bytes()
