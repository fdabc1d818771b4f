"""The fast codec agrees with rosbags byte for byte, whatever the names and lengths."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from idloop.records.bags.cdr import CdrError, read_layout
from idloop.records.bags.joint_states import decode_joint_states, decode_rows, encode_rows
from idloop.records.bags.stream import JOINT_STATE

NAMES = st.lists(st.text("abcdefgh_ö", min_size=1, max_size=9), min_size=1, max_size=4, unique=True)
ONCE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


@ONCE
@given(names=NAMES, present=st.tuples(st.booleans(), st.booleans(), st.booleans()), seed=st.integers(0, 99))
def test_encoding_is_what_rosbags_writes(joint_state, typestore, names, present, seed):
    rng = np.random.default_rng(seed)
    stamps = rng.integers(0, 2**31 * 10**9, size=3)
    values = tuple(rng.normal(size=(3, len(names))) if there else None for there in present)
    rows = encode_rows(tuple(names), stamps, values)
    for k in range(3):
        parts = [() if value is None else value[k] for value in values]
        message = joint_state(int(stamps[k]), names, *parts, frame="")
        assert rows[k].tobytes() == bytes(typestore.serialize_cdr(message, JOINT_STATE))
    layout = read_layout(rows[0].tobytes())
    assert layout.names == tuple(names)
    decoded_stamps, decoded = decode_rows(rows, layout)
    np.testing.assert_array_equal(decoded_stamps, stamps)
    for value, read in zip(values, decoded, strict=True):
        np.testing.assert_array_equal(np.zeros((3, 0)) if value is None else value, read)


@ONCE
@given(data=st.data())
def test_decoding_is_what_rosbags_reads_when_joints_come_go_and_change_place(joint_state, typestore, data):
    payloads = []
    for k in range(data.draw(st.integers(1, 12))):
        names = data.draw(st.permutations(["motor", "load", "b"]))[: data.draw(st.integers(0, 3))]
        lengths = [data.draw(st.sampled_from([0, len(names)])) for _ in range(3)]
        message = joint_state(k * 1_000_000, names, *[np.arange(n) + 10 * k + n for n in lengths])
        payloads.append(bytes(typestore.serialize_cdr(message, JOINT_STATE)))
    stamp, names, values = decode_joint_states(payloads)
    messages: list[Any] = [typestore.deserialize_cdr(payload, JOINT_STATE) for payload in payloads]
    assert names == tuple(dict.fromkeys(name for message in messages for name in message.name))
    for k, message in enumerate(messages):
        assert stamp[k] == message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        for field, value in zip(("position", "velocity", "effort"), values, strict=True):
            given = dict(zip(message.name, getattr(message, field), strict=False))
            np.testing.assert_array_equal(value[k], [given.get(name, np.nan) for name in names])


def test_big_endian_messages_are_read(joint_state, typestore):
    message = joint_state(1_500_000_000, ["motor"], [1.5], [], [-2.0])
    payload = bytes(typestore.serialize_cdr(message, JOINT_STATE, little_endian=False))
    stamp, names, (position, velocity, effort) = decode_joint_states([payload, payload])
    assert names == ("motor",)
    assert stamp.tolist() == [1_500_000_000] * 2
    assert position.tolist() == [[1.5]] * 2
    assert effort.tolist() == [[-2.0]] * 2
    assert np.isnan(velocity).all()


def test_what_is_not_plain_cdr_is_refused(joint_state, typestore):
    payload = bytes(typestore.serialize_cdr(joint_state(1, ["motor"], [1.0]), JOINT_STATE))
    decode_joint_states([payload])
    for damaged in (b"\x00\x07" + payload[2:], payload[:-9], payload + bytes(16)):
        with pytest.raises(CdrError):
            decode_joint_states([payload, damaged])


def test_many_changing_layouts_are_read_message_by_message(joint_state, typestore):
    payloads = [
        bytes(typestore.serialize_cdr(joint_state(k, [f"joint{k:03d}"], [float(k)]), JOINT_STATE)) for k in range(60)
    ]
    stamp, names, (position, _, _) = decode_joint_states(payloads)
    assert stamp.tolist() == list(range(60))
    assert names == tuple(f"joint{k:03d}" for k in range(60))
    np.testing.assert_array_equal(np.diag(position), np.arange(60.0))


def test_values_without_names_are_numbered(joint_state, typestore):
    payload = bytes(typestore.serialize_cdr(joint_state(1, [], [3.0, 4.0]), JOINT_STATE))
    _, names, (position, _, _) = decode_joint_states([payload])
    assert names == ("0", "1")
    assert position.tolist() == [[3.0, 4.0]]


def test_a_name_that_claims_to_be_longer_than_its_message_takes_no_memory():
    row = encode_rows(("axis",), np.array([10**9]), (np.zeros((1, 1)), None, None))[0].tobytes()
    at = row.index(b"axis") - 4
    claims = row[:at] + b"\xff\xff\xff\xff" + row[at + 4 :]
    tracemalloc.start()
    with pytest.raises(CdrError, match="cannot be in"):
        read_layout(claims)
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()
