"""The last chunk of an mcap file, of which only the beginning was written."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer

from idloop.errors import InputError
from idloop.records import read_streams, write_bag
from idloop.records.bags.recover import recover_bag
from idloop.records.bags.storage.readable_messages import cut_chunk_records, mcap_messages
from idloop.records.bags.write import make_stream

STAMPS = np.arange(1, 6001, dtype=np.int64) * 10_000_000
RANDOM = np.random.default_rng(0).normal(size=6000)  # which hardly shrinks: the blocks of a packed chunk are many


@pytest.fixture(scope="module")
def messages(tmp_path_factory):
    stream = make_stream("joint_states", STAMPS, {"motor": {"position": RANDOM}})
    (file,) = write_bag(tmp_path_factory.mktemp("bags") / "whole", [stream], storage="mcap").glob("*.mcap")
    return list(mcap_messages(file))


def _write(path, messages, compression, chunk_size=1 << 30):
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, chunk_size=chunk_size, index_types=IndexType.NONE)
        writer.start("ros2")
        channel = messages[0].channel
        schema = writer.register_schema(channel.message_type, "ros2msg", channel.definition.encode())
        number = writer.register_channel(channel.topic, channel.serialization, schema)
        for one in messages:
            writer.add_message(number, one.stamp_ns, one.data, one.stamp_ns)
        writer.finish()
    return path.read_bytes()


@pytest.mark.parametrize("compression", list(CompressionType))
def test_of_one_chunk_what_was_written_before_the_cut_is_saved(messages, tmp_path, compression):
    whole = _write(tmp_path / "whole.mcap", messages, compression)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 6 // 10])
    with pytest.raises(InputError, match=r"cut off .*idloop recover"):
        read_streams(cut)
    result = recover_bag(cut, tmp_path / "saved")
    assert result.cut == (cut,)
    assert 2000 < result.messages < 5500
    saved = read_streams(tmp_path / "saved")["/joint_states"]
    np.testing.assert_array_equal(saved.stamp_ns, STAMPS[: result.messages])
    np.testing.assert_array_equal(saved.position[:, 0], RANDOM[: result.messages])


def test_chunks_before_the_cut_one_are_read_once(messages, tmp_path):
    whole = _write(tmp_path / "whole.mcap", messages, CompressionType.NONE, chunk_size=100_000)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[:250_000])
    *found, end = mcap_messages(cut)
    assert end is None
    stamps = [one.stamp_ns for one in found]
    assert stamps == STAMPS[: len(stamps)].tolist()
    assert 250_000 - sum(len(one.data) + 31 for one in found) < 10_000


@pytest.mark.parametrize("kept", [0, 8, 20, 60, 100])
def test_a_file_that_ends_before_its_first_message_gives_none(messages, tmp_path, kept):
    whole = _write(tmp_path / "whole.mcap", messages[:10], CompressionType.NONE)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[:kept])
    assert list(cut_chunk_records(cut)) == []
    assert list(mcap_messages(cut)) == [None]


def test_a_whole_file_and_any_bytes_have_no_cut_chunk(messages, tmp_path):
    _write(tmp_path / "whole.mcap", messages[:10], CompressionType.ZSTD)
    assert list(cut_chunk_records(tmp_path / "whole.mcap")) == []
    chunk = struct.pack("<BQ", 6, 1 << 40)
    for k, tail in enumerate((b"", b"\xff" * 200, b"\0" * 28 + struct.pack("<I", 4) + b"none" + b"\0" * 40)):
        (tmp_path / f"{k}.mcap").write_bytes(b"\x89MCAP0\r\n" + chunk + tail)
        assert list(cut_chunk_records(tmp_path / f"{k}.mcap")) == []
