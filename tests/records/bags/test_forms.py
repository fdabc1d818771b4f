"""One recording in every form that a recorder gives it is read as the same streams."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from idloop.errors import InputError
from idloop.records import read_streams, write_bag
from idloop.records.bags.bag import Bag
from idloop.records.bags.recover import recover_bag
from idloop.records.bags.storage import unpacking
from idloop.records.bags.storage.storage_files import bag_name
from idloop.records.bags.stream import JOINT_STATE
from idloop.records.bags.write import make_stream

COUNT = 40
STORAGES = ["MCAP", "SQLITE3"]


def check(path: Path) -> None:
    """Both topics are there, and nothing was written beside them."""
    folder = path if path.is_dir() else path.parent
    before = sorted(folder.iterdir())
    streams = read_streams(path)
    np.testing.assert_array_equal(streams["/joint_states"].column("j", "position"), np.arange(COUNT) / 8)
    assert streams["/joint_states"].stamp_ns.tolist() == list(range(1, COUNT + 1))
    np.testing.assert_array_equal(streams["/u"].column("0", "effort"), np.arange(COUNT) / 4)
    assert sorted(folder.iterdir()) == before


@pytest.fixture
def record(typestore: Any, joint_state: Any) -> Any:
    """Write the recording with rosbags, as a recorder would."""

    def write(path: Path, storage: str, mode: CompressionMode = CompressionMode.NONE) -> Path:
        writer = Writer(path, version=9, storage_plugin=StoragePlugin[storage])
        if mode != CompressionMode.NONE:
            writer.set_compression(mode, CompressionFormat.ZSTD)
        number = typestore.types["std_msgs/msg/Float64"]
        with writer:
            states = writer.add_connection("/joint_states", JOINT_STATE, typestore=typestore)
            command = writer.add_connection("/u", "std_msgs/msg/Float64", typestore=typestore)
            for k in range(COUNT):
                state = typestore.serialize_cdr(joint_state(k + 1, ["j"], [k / 8]), JOINT_STATE)
                writer.write(states, 10**18 + k, state)
                writer.write(command, 10**18 + k, typestore.serialize_cdr(number(k / 4), "std_msgs/msg/Float64"))
        return path

    return write


def storage_file(bag: Path) -> Path:
    return next(one for one in bag.iterdir() if one.name != "metadata.yaml")


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("mode", list(CompressionMode))
def test_folder_with_and_without_metadata_and_bare_file(
    record: Any, tmp_path: Path, storage: str, mode: CompressionMode
) -> None:
    if storage == "SQLITE3" and mode == CompressionMode.STORAGE:
        mode = CompressionMode.NONE  # only mcap packs its own chunks
    bag = record(tmp_path / "run_0.5", storage, mode)
    check(bag)
    file = shutil.copy(storage_file(bag), tmp_path)
    check(Path(file))
    (bag / "metadata.yaml").unlink()
    check(bag)
    saved = recover_bag(bag, tmp_path / "saved")
    assert (saved.messages, saved.cut) == (2 * COUNT, ())
    check(tmp_path / "saved")


@pytest.mark.parametrize("storage", STORAGES)
def test_the_metadata_need_not_know_the_storage(record: Any, tmp_path: Path, storage: str) -> None:
    bag = record(tmp_path / "bag", storage)
    metadata = bag / "metadata.yaml"
    text, count = re.subn(r"storage_identifier: .*", "storage_identifier: ''", metadata.read_text())
    assert count == 1
    metadata.write_text(text)
    check(bag)


def test_a_file_that_was_renamed_or_packed_since_is_found(record: Any, tmp_path: Path) -> None:
    from backports import zstd

    bag = record(tmp_path / "bag", "MCAP")
    file = storage_file(bag)
    file.with_name(file.name + ".zst").write_bytes(zstd.compress(file.read_bytes()))
    file.unlink()
    check(bag)
    storage_file(bag).rename(bag / "renamed.mcap.zstd")
    check(bag)


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("metadata", [True, False])
def test_a_split_bag_is_read_in_its_order(tmp_path: Path, storage: str, *, metadata: bool) -> None:
    bag, names = tmp_path / "bag", []
    bag.mkdir()
    stamps = np.arange(1, 121, dtype=np.int64) * 10**9
    for number in range(12):
        rows = slice(10 * number, 10 * number + 10)
        part = make_stream("joint_states", stamps[rows], {"j": {"position": stamps[rows] * 1e-9}})
        one = write_bag(tmp_path / "one", [part], storage=storage.lower())
        file = storage_file(one)
        names.append(f"bag_{number}{file.suffix}")
        file.rename(bag / names[-1])
        text = (one / "metadata.yaml").read_text()
        shutil.rmtree(one)
    if metadata:
        listed = "\n".join(f"  - {name}" for name in names)
        text = re.sub(r"relative_file_paths:\n  - .*", f"relative_file_paths:\n{listed}", text)
        (bag / "metadata.yaml").write_text(text)
    assert read_streams(bag)["/joint_states"].stamp_ns.tolist() == stamps.tolist()
    if metadata:
        (bag / names[3]).unlink()
        with pytest.raises(InputError, match=re.escape(names[3])):
            read_streams(bag)


@pytest.mark.parametrize("compression", [None, *Ros1Writer.CompressionFormat])
def test_a_bag_of_ros_1(ros1_bag: Any, tmp_path: Path, compression: Any) -> None:
    bag = ros1_bag(tmp_path / "run_0.5.bag", compression)
    check(bag)
    assert bag_name(bag) == "run_0.5"
    saved = recover_bag(bag, tmp_path / "saved")
    assert (saved.messages, saved.cut) == (2 * COUNT, ())
    check(tmp_path / "saved")


@pytest.mark.parametrize("profile", ["", "ros1", "x" * 40])
def test_an_mcap_file_that_no_recorder_of_ros_2_wrote(tmp_path: Path, joint_state: Any, profile: str) -> None:
    from mcap.writer import Writer as McapWriter
    from rosbags.typesys import Stores, get_typestore

    old, new = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.LATEST)
    ros1 = profile == "ros1"
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile=profile, library="test")
        channels = {}
        for topic, kind in (("/joint_states", JOINT_STATE), ("/u", "std_msgs/msg/Float64")):
            text, _ = (old if ros1 else new).generate_msgdef(kind, ros_version=1 if ros1 else 2)
            name, encoding = (kind.replace("/msg/", "/"), "ros1") if ros1 else (kind, "cdr")
            schema = writer.register_schema(name, f"{'ros1' if ros1 else 'ros2'}msg", text.encode())
            channels[topic] = writer.register_channel(topic, encoding, schema)
        other = writer.register_channel("/status", "json", writer.register_schema("status", "jsonschema", b"{}"))
        for strange in (other, writer.register_channel("/note", "json", 0)):
            writer.add_message(strange, 10**18, b"{}", 10**18)
        number = new.types["std_msgs/msg/Float64"]
        for k in range(COUNT):
            for topic, kind, message in (
                ("/joint_states", JOINT_STATE, joint_state(k + 1, ["j"], [k / 8])),
                ("/u", "std_msgs/msg/Float64", number(k / 4)),
            ):
                data = bytes(new.serialize_cdr(message, kind))
                writer.add_message(
                    channels[topic], 10**18 + k, bytes(new.cdr_to_ros1(data, kind)) if ros1 else data, 10**18 + k
                )
        writer.finish()
    check(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="cut off"):
        read_streams(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty (0 bytes)"),
        (b"\x28\xb5\x2f\xfd\x00", "cannot be unpacked"),
        (b"t,u\n0,1\n", "holds no recording"),
    ],
)
def test_a_packed_file_that_is_none(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "a.db3.zstd"
    path.write_bytes(content)
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        read_streams(path)
    assert "\n" not in str(caught.value)


def test_a_full_disk_is_not_filled(record: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = record(tmp_path / "bag", "MCAP", CompressionMode.FILE)
    monkeypatch.setattr(unpacking, "_LEFT_FREE", 1 << 62)
    with pytest.raises(InputError, match=r"no room in .*TMPDIR"):
        read_streams(bag)


def test_what_was_unpacked_is_removed(record: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    with Bag(record(tmp_path / "bag", "SQLITE3", CompressionMode.FILE)):
        assert list((tmp_path / "temporary").glob("*/*.db3"))
    assert not list((tmp_path / "temporary").iterdir())


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("bags/run_0.5", "run_0.5"),
        ("run_0.7.mcap", "run_0.7"),
        ("run.db3.zstd", "run"),
        ("a.b.c.bag", "a.b.c"),
        (".mcap", ".mcap"),
    ],
)
def test_the_name_of_a_bag_keeps_its_dots(path: str, name: str) -> None:
    assert bag_name(path) == name


def test_a_record_has_the_whole_name_of_its_bag(tmp_path: Path) -> None:
    from idloop.records import read_record
    from idloop.records.bags.axis_signals import axis_signals

    stamps = np.arange(1, COUNT + 1, dtype=np.int64) * 10**7
    wave = np.sin(np.arange(float(COUNT)))
    streams = [
        make_stream("joint_command", stamps, {"j": {"effort": np.sign(wave)}}),
        make_stream("joint_states", stamps, {"j": {"position": wave}}),
    ]
    bag = write_bag(tmp_path / "run_0.5", streams)
    assert read_record(bag, axis_signals(bag)).name == "run_0.5"


def test_fewer_messages_than_announced_are_said(record: Any, tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", "SQLITE3")
    metadata = bag / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace(f"message_count: {COUNT}", f"message_count: {COUNT + 2}"))
    findings = read_streams(bag)["/joint_states"].findings
    assert [(one.kind, one.level) for one in findings] == [("fewer_messages", "warning")]
    assert "40 of 42 messages" in findings[0].text
