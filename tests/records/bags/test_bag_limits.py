"""Recordings that unpack or expand without an end are refused in one line."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from idloop.errors import IdloopError, InputError
from idloop.graph.live_results import read_results
from idloop.records import write_bag
from idloop.records.bags.bag import Bag
from idloop.records.bags.recover import recover_bag
from idloop.records.bags.storage import unpacking
from idloop.records.bags.write import make_stream

# A DiagnosticArray with a very long name of its frame.
TYPE = "diagnostic_msgs/msg/DiagnosticArray"
LONG = b"\x00\x01\x00\x00" + bytes(8) + (8 << 20).to_bytes(4, "little") + bytes((8 << 20) + 4)
LAUGH = "[&x0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]" + "".join(
    f", &x{k} [{', '.join([f'*x{k - 1}'] * 10)}]" for k in range(1, 10)
)


def chunk(path: Path, compression: CompressionType) -> Path:
    """A recording of one long message, in a short compressed chunk."""
    with path.open("wb") as file:
        writer = McapWriter(file, compression=compression, chunk_size=1 << 26)
        writer.start(profile="ros2", library="test")
        text, _ = get_typestore(Stores.LATEST).generate_msgdef(TYPE, ros_version=2)
        schema = writer.register_schema(TYPE, "ros2msg", text.encode())
        writer.add_message(writer.register_channel("/estimator/fit", "cdr", schema), 1, LONG, 1, 0)
        writer.finish()
    assert path.stat().st_size < 100_000
    return path


def packed(path: Path, mode: CompressionMode) -> Path:
    """A recording of one long message that ros2 bag compressed."""
    bag = Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    bag.set_compression(mode, CompressionFormat.ZSTD)
    with bag as writer:
        store = get_typestore(Stores.LATEST)
        writer.write(writer.add_connection("/said", "std_msgs/msg/String", typestore=store), 1, LONG)
    return path


def messages(path: Path) -> list[bytes]:
    with Bag(path) as bag:
        ((_, found),) = bag.raw(list(bag.topics)).values()
    return found


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unpacking, "MOST_UNPACKED", 1 << 20)


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_chunk_within_the_limit_is_read(compression: CompressionType, tmp_path: Path) -> None:
    path = chunk(tmp_path / "run.mcap", compression)
    assert messages(path) == [LONG]
    assert recover_bag(path, tmp_path / "saved").messages == 1


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_chunk_beyond_the_limit_is_one_line(compression: CompressionType, tmp_path: Path) -> None:
    path = chunk(tmp_path / "run.mcap", compression)
    with pytest.raises(InputError, match=r"damaged inside \(a chunk or message unpacks to more than 1 MiB\)"):
        messages(path)
    with pytest.raises(IdloopError, match="unpacks to more than 1 MiB"):
        read_results(path)
    with pytest.raises(IdloopError, match="no message in it can be read"):
        recover_bag(path, tmp_path / "saved")


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_a_compressed_recording_within_the_limit_is_read(mode: CompressionMode, tmp_path: Path) -> None:
    assert messages(packed(tmp_path / "bag", mode)) == [LONG]


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_a_compressed_recording_beyond_the_limit_is_one_line(mode: CompressionMode, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"unpacks to more than (1 MiB|200 times its size)"):
        messages(packed(tmp_path / "bag", mode))


def test_qualities_of_service_that_expand_are_one_line(tmp_path: Path) -> None:
    stamps = np.arange(1, 21, dtype=np.int64) * 10_000_000
    stream = make_stream("joint_command", stamps, {"axis": {"effort": np.ones(20)}})
    bag = write_bag(tmp_path / "bag", [stream], storage="sqlite3")
    with sqlite3.connect(next(bag.glob("*.db3"))) as base:
        base.execute("UPDATE topics SET offered_qos_profiles = ?", (LAUGH + "]",))
    base.close()
    with pytest.raises(InputError, match=r"offered_qos_profiles|more than 200,000 values"):
        messages(bag)


def test_metadata_that_expand_are_one_line(tmp_path: Path) -> None:
    stamps = np.arange(1, 21, dtype=np.int64) * 10_000_000
    bag = write_bag(tmp_path / "bag", [make_stream("joint_command", stamps, {"axis": {"effort": np.ones(20)}})])
    metadata = bag / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("compression_mode: ''", f"compression_mode: {LAUGH}]"))
    with pytest.raises(InputError, match="cannot be read as a bag"):
        messages(bag)
