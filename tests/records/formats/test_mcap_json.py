"""Messages of JSON in an MCAP file are columns; other messages are named with the way out."""

from __future__ import annotations

import json

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from idloop.api.log import recognise
from idloop.errors import InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.storage.bag_paths import is_bag
from idloop.records.tables.table_files import read_table

T = np.arange(400) * 0.005


def _log(path, *, schema=True, compression=CompressionType.ZSTD, encoding="json"):
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start("", "a logger")
        kind = writer.register_schema("State", "jsonschema", b"{}") if schema else 0
        state = writer.register_channel("/motor/state", encoding, kind)
        command = writer.register_channel("/motor/cmd", encoding, kind)
        for when in T:
            stamp = int((1.7e9 + when) * 1e9)
            place = {"pos_deg": np.degrees(np.sin(9.0 * when)), "ok": True, "name": "a", "coil": [1.0, when]}
            for channel, content in ((command, {"iq_cmd": float(np.sign(np.sin(5.0 * when)))}), (state, place)):
                writer.add_message(channel, stamp, json.dumps(content).encode(), stamp)
        writer.finish()
    return path


@pytest.mark.parametrize("schema", [True, False])
@pytest.mark.parametrize("compression", list(CompressionType))
def test_numbers_are_columns_with_the_stamps_of_their_topic(tmp_path, schema, compression):
    path = _log(tmp_path / "a.mcap", schema=schema, compression=compression)
    assert not is_bag(path)
    table = read_table(path)
    np.testing.assert_allclose(table.numbers("/motor/state/coil[1]"), T)
    assert table.clocks["/motor/cmd/iq_cmd"] == "/motor/cmd.time"
    np.testing.assert_allclose(table.numbers("/motor/cmd.time"), T + 1.7e9, atol=1e-6)


def test_it_is_started_as_a_log(tmp_path):
    found = recognise(_log(tmp_path / "a.mcap"), {}).recognition
    assert (found.of("command").column, found.of("position").column) == ("/motor/cmd/iq_cmd", "/motor/state/pos_deg")
    assert (found.of("position").unit, found.base.time.column) == ("deg", "/motor/state.time")


def test_a_file_that_is_cut_off_gives_what_is_before_the_cut(tmp_path):
    path = _log(tmp_path / "a.mcap", compression=CompressionType.NONE)
    path.write_bytes(path.read_bytes()[:40_000])
    assert not is_bag(path)
    table = read_table(path)
    assert any("cut off" in note for note in table.notes)
    assert 50 < len(table.columns["/motor/state/pos_deg"]) < T.size


def test_messages_of_another_encoding_are_named(tmp_path):
    with pytest.raises(InputError, match="its messages are protobuf and not of ROS: export the signals as CSV"):
        Bag(_log(tmp_path / "a.mcap", encoding="protobuf"))
    with pytest.raises(InputError, match="its messages are JSON and not of ROS: `idloop start"):
        Bag(_log(tmp_path / "b.mcap"))


@pytest.mark.parametrize("content", [b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" + bytes(300)])
def test_what_holds_no_message_is_one_line(tmp_path, content):
    (tmp_path / "a.bin").write_bytes(content)
    with pytest.raises(InputError, match=r"MCAP file|no messages"):
        read_table(tmp_path / "a.bin")
