"""Writing bags of our topics."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.records.bags.joint_states import encode_rows
from idloop.records.bags.metadata import CONDITION_UNITS
from idloop.records.bags.stream import FIELDS, JOINT_STATE, JointStream
from idloop.records.measured_conditions import FIELD, conditions_columns
from idloop.records.measured_conditions import TOPIC as CONDITIONS
from idloop.records.record import Record

# At equal times causes come first: reference, measurement, command.
_RANKS = {"reference": 0, "excitation": 1, CONDITIONS: 2, "joint_states": 3, "joint_command": 4}


def write_bag(
    path: Path | str,
    content: Record | Iterable[JointStream] | Mapping[str, JointStream],
    *,
    custom: Mapping[str, str] | None = None,
    storage: str = "mcap",
) -> Path:
    """Write streams as a rosbag2 directory of sensor_msgs/JointState topics.

    `path`: directory to create; an existing one is never overwritten.
    `content`: a record is written to the topics ``joint_command``, ``joint_states``, ``reference``, ``excitation``,
    ``conditions``.
    `custom`: text stored with the bag's metadata.
    `storage`: one of "mcap", "sqlite3".
    Returns: the directory.
    Raises InputError: `path` exists, cannot be created, or there is nothing to write.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    path = Path(path)
    if path.exists():
        raise InputError(f"{path}: exists already and is not overwritten; choose another name or remove it")
    streams = (
        record_streams(content)
        if isinstance(content, Record)
        else list(content.values() if isinstance(content, Mapping) else content)
    )
    streams = [stream for stream in streams if len(stream)]
    if not streams:
        raise InputError(f"{path}: nothing to write, every stream is empty")
    if any(not stream.is_joint_state for stream in streams):
        raise InputError(f"{path}: only {JOINT_STATE} streams can be written")
    if storage not in ("mcap", "sqlite3"):
        raise InputError(f"storage {storage!r} is unknown; use mcap or sqlite3")
    streams.sort(key=lambda stream: _RANKS.get(stream.topic.rsplit("/", 1)[-1], len(_RANKS)))
    typestore = get_typestore(Stores.ROS2_JAZZY)
    when = np.concatenate([stream.receive_ns for stream in streams])
    whose = np.repeat(np.arange(len(streams)), [len(stream) for stream in streams])
    payloads = [one for stream in streams for one in _payloads(stream)]
    texts = dict(custom or {})
    if isinstance(content, Record) and content.conditions:
        # No model states the units of the conditions.
        texts = {CONDITION_UNITS: json.dumps({one.name: one.unit for one in content.conditions})} | texts
    try:
        with Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()]) as writer:
            for key, text in texts.items():
                writer.set_custom_data(key, text)
            connections = [
                writer.add_connection("/" + stream.topic.removeprefix("/"), JOINT_STATE, typestore=typestore)
                for stream in streams
            ]
            for row in np.argsort(when, kind="stable").tolist():
                writer.write(connections[whose[row]], int(when[row]), payloads[row])
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    return path


def _payloads(stream: JointStream) -> list[bytes]:
    values = [getattr(stream, field) for field in FIELDS]
    # A field that no message carries stays an empty sequence, as ROS has it for "not available".
    position, velocity, effort = (None if np.isnan(value).all() else value for value in values)
    return [row.tobytes() for row in encode_rows(stream.names, stream.stamp_ns, (position, velocity, effort))]


def record_streams(record: Record) -> list[JointStream]:
    """Return a record as the streams of our topics: command, measurement, reference, excitation, conditions."""
    joint, _, field = record.input_name.rpartition(".")
    streams = [make_stream("joint_command", record.absolute(record.input_time), {joint: {field: record.input}})]
    measured: dict[str, dict[str, Array]] = {}
    for name, values in zip(record.output_names, record.output.T, strict=True):
        output_joint, _, output_field = name.rpartition(".")
        measured.setdefault(output_joint, {})[output_field] = values
    streams.append(make_stream("joint_states", record.absolute(record.time), measured))
    for topic, stamps, values, second in (
        ("reference", record.reference_time, record.reference, "velocity"),
        ("excitation", record.excitation_time, record.excitation, "effort"),
    ):
        if stamps is not None and values is not None:
            fields = {"position": values[:, 0], second: values[:, 1]}
            streams.append(make_stream(topic, record.absolute(stamps), {joint: fields}))
    if record.conditions:
        stamp_ns, columns = conditions_columns(record.conditions, record.start_ns)
        streams.append(make_stream(CONDITIONS, stamp_ns, {name: {FIELD: value} for name, value in columns.items()}))
    return streams


def make_stream(
    topic: str,
    stamp_ns: Integers,
    joints: Mapping[str, Mapping[str, Array]],
    receive_ns: Integers | None = None,
) -> JointStream:
    """Build a JointState stream from columns, joint to field to values (n,)."""
    names = tuple(joints)
    blocks = np.full((len(FIELDS), stamp_ns.size, len(names)), np.nan)
    for block, field in zip(blocks, FIELDS, strict=True):
        for index, name in enumerate(names):
            if field in joints[name]:
                block[:, index] = joints[name][field]
    return JointStream(topic, stamp_ns, stamp_ns if receive_ns is None else receive_ns, names, *blocks)
