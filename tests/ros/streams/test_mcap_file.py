"""An mcap file of ours holds what the package mcap writes and reads."""

from __future__ import annotations

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from mcap.reader import SeekingReader
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from idloop_nodes.streams.mcap_file import McapFile

MESSAGES = st.lists(
    st.tuples(
        st.sampled_from(["/a", "/b", "/ü"]), st.integers(0, 2**63 - 1), st.binary(max_size=40), st.integers(0, 9)
    ),
    max_size=40,
)


def ours(messages, chunk_size):
    sink = io.BytesIO()
    file = McapFile(sink, chunk_size, "tested")
    schema = file.add_schema("std_msgs/msg/Header", "ros2msg", b"string frame_id")
    channels = {topic: file.add_channel(topic, "cdr", schema, {"of": topic, "x": ""}) for topic in ("/a", "/b", "/ü")}
    for topic, time, data, sequence in messages:
        file.add_message(channels[topic], time, data, sequence)
    file.finish()
    return sink


def theirs(messages, chunk_size):
    sink = io.BytesIO()
    writer = Writer(sink, chunk_size=chunk_size, compression=CompressionType.NONE)
    writer.start(profile="ros2", library="tested")
    schema = writer.register_schema("std_msgs/msg/Header", "ros2msg", b"string frame_id")
    names = ("/a", "/b", "/ü")
    channels = {topic: writer.register_channel(topic, "cdr", schema, {"of": topic, "x": ""}) for topic in names}
    for topic, time, data, sequence in messages:
        writer.add_message(channels[topic], time, data, time, sequence)
    writer.finish()
    return sink


def content(sink):
    """Everything that a reader can see: header, summary with indexes and statistics, messages in order of time."""
    sink.seek(0)
    reader = SeekingReader(sink, validate_crcs=True)
    messages = list(reader.iter_messages())
    return reader.get_header(), vars(reader.get_summary()), messages


@given(MESSAGES, st.sampled_from([60, 400, 16384]))
def test_a_file_says_what_the_package_would_have_said(messages, chunk_size):
    assert content(ours(messages, chunk_size)) == content(theirs(messages, chunk_size))


@given(MESSAGES, st.sampled_from([60, 400, 16384]))
def test_a_file_can_be_read_as_a_stream(messages, chunk_size):
    sink = ours(messages, chunk_size)
    records = [type(one).__name__ for one in StreamReader(io.BytesIO(sink.getvalue())).records]
    assert records.count("Message") == len(messages)
    assert records[0] == "Header"
    assert records[-1] == "Footer"
