"""Recordings are rosbag2 directories that others read, and survive a kill."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from itertools import pairwise
from pathlib import Path

import pytest
import yaml

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.errors import InputError
from idloop_nodes.codec import JointSample, encode_joint_state
from idloop_nodes.streams.bag_writer import BagWriter, choose_folder

TOPICS = {"/joint_states": "sensor_msgs/msg/JointState", "/joint_command": "sensor_msgs/msg/JointState"}


def payload(stamp):
    return encode_joint_state(JointSample(stamp, ("motor",), (stamp / 1e9,)))


def read(folder):
    from rosbags.highlevel import AnyReader

    with AnyReader([folder]) as reader:
        return [(connection.topic, stamp, bytes(data)) for connection, stamp, data in reader.messages()]


def metadata(folder):
    return yaml.safe_load((folder / "metadata.yaml").read_text(encoding="utf-8"))["rosbag2_bagfile_information"]


def fill(writer, count, start=10**9):
    messages = []
    for index in range(count):
        stamp = start + index * 10**6
        topic = ("/joint_states", "/joint_command")[index % 2]
        writer.write(topic, stamp, payload(stamp))
        messages.append((topic, stamp, payload(stamp)))
    return messages


@pytest.mark.parametrize("limits", [{}, {"split_bytes": 20_000}, {"split_ns": 100 * 10**6}])
def test_what_was_written_is_read(tmp_path, limits):
    writer = BagWriter(tmp_path / "bag", TOPICS, "kilted", **limits)
    messages = fill(writer, 500)
    writer.close()
    assert read(tmp_path / "bag") == messages
    files = sorted((tmp_path / "bag").glob("*.mcap"))
    assert (len(files) > 1) == bool(limits)


def test_messages_keep_canonical_order_at_equal_times(tmp_path):
    writer = BagWriter(tmp_path / "bag", TOPICS, "kilted")
    topics = ["/joint_states", "/joint_command"] * 400
    for index, topic in enumerate(topics):
        writer.write(topic, 10**9 + index // 2, payload(10**9 + index // 2))
    writer.close()
    assert [topic for topic, _, _ in read(tmp_path / "bag")] == topics


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {here!r})
from test_bag_writer import TOPICS, fill
from idloop_nodes.streams.bag_writer import BagWriter
fill(BagWriter(Path({folder!r}), TOPICS, "kilted"), 2000)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_recorder_loses_at_most_a_chunk(tmp_path):
    from mcap.exceptions import EndOfFile
    from mcap.stream_reader import StreamReader

    script = KILLED.format(here=str(Path(__file__).parent), folder=str(tmp_path / "bag"))
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == -signal.SIGKILL
    found = []
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream, contextlib.suppress(EndOfFile):
        found.extend(record for record in StreamReader(stream).records if hasattr(record, "log_time"))
    assert len(found) >= 2000 - 16 * 1024 // len(payload(0))
    assert all(a.log_time < b.log_time for a, b in pairwise(found))


def test_metadata_is_what_rosbag2_expects(tmp_path):
    writer = BagWriter(tmp_path / "bag", TOPICS, "kilted")
    fill(writer, 10)
    writer.close()
    information = metadata(tmp_path / "bag")
    assert information["version"] == 9
    assert information["storage_identifier"] == "mcap"
    assert information["message_count"] == 10
    assert information["duration"]["nanoseconds"] == 9 * 10**6
    assert [one["message_count"] for one in information["topics_with_message_count"]] == [5, 5]
    assert information["relative_file_paths"] == [one["path"] for one in information["files"]]
    assert "&" not in (tmp_path / "bag" / "metadata.yaml").read_text()


def test_a_bag_without_a_message_is_not_kept(tmp_path):
    writer = BagWriter(tmp_path / "bag", TOPICS, "kilted")
    assert (tmp_path / "bag" / "metadata.yaml").exists()
    writer.close()
    assert not (tmp_path / "bag").exists()
    again = BagWriter(tmp_path / "bag", TOPICS, "kilted")
    (tmp_path / "bag" / "notes.txt").write_text("mine")
    again.close()
    assert [file.name for file in (tmp_path / "bag").iterdir()] == ["notes.txt"]


def test_nothing_is_written_over(tmp_path):
    (tmp_path / "bag").mkdir()
    with pytest.raises(InputError, match="not written over"):
        choose_folder(str(tmp_path / "bag"), "", "")


def test_names_by_time_never_collide(tmp_path):
    first = choose_folder("", str(tmp_path), "run")
    first.mkdir()
    second = choose_folder("", str(tmp_path), "run")
    assert first != second
    assert not second.exists()


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be made"):
        BagWriter(tmp_path / "file" / "bag", TOPICS, "kilted")


def test_a_folder_closed_for_new_files_still_says_what_was_recorded(tmp_path, monkeypatch):
    writer = BagWriter(tmp_path / "bag", TOPICS, "kilted")
    messages = fill(writer, 100)

    def refused(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "replace", refused)
    writer.close()
    assert read(tmp_path / "bag") == messages


def test_a_split_for_which_no_file_can_be_made_leaves_a_bag_that_is_read(tmp_path, monkeypatch):
    writer = BagWriter(tmp_path / "bag", TOPICS, "kilted", split_ns=100 * 10**6)
    messages = fill(writer, 100)

    def refused(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(BagWriter, "_open_file", refused)
    with pytest.raises(PermissionError):
        fill(writer, 1, start=2 * 10**9)
    writer.close()
    assert read(tmp_path / "bag") == messages
    assert metadata(tmp_path / "bag")["message_count"] == 100


def test_a_place_where_a_folder_can_be_made_and_no_file_is_one_line(tmp_path, monkeypatch):
    def refused(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(BagWriter, "_open_file", refused)
    with pytest.raises(InputError, match="cannot be made: No space left on device"):
        BagWriter(tmp_path / "bag", TOPICS, "kilted")


def test_a_busy_disk_holds_up_no_message(tmp_path, monkeypatch):
    busy = threading.Event()
    monkeypatch.setattr(os, "fsync", lambda _: busy.wait(60.0))
    writer = BagWriter(tmp_path / "bag", TOPICS, "kilted", split_ns=100 * 10**6)
    messages = fill(writer, 1000)
    assert len(list((tmp_path / "bag").glob("*.mcap"))) > 3
    busy.set()
    writer.close()
    assert read(tmp_path / "bag") == messages


def test_a_disk_that_fails_is_told(tmp_path, monkeypatch):
    def fails(_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", fails)
    writer = BagWriter(tmp_path / "bag", TOPICS, "kilted", split_ns=100 * 10**6)
    fill(writer, 150)
    with pytest.raises(OSError, match="Input/output"):
        writer.close()
