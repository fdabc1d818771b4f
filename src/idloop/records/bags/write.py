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
_ORDER = ("reference", "excitation", CONDITIONS, "joint_states", "joint_command")


def write_bag(
    path: Path | str,
    content: Record | Iterable[JointStream] | Mapping[str, JointStream],
    *,
    custom: Mapping[str, str] | None = None,
    storage: str = "mcap",
) -> Path:
    """Write streams as a rosbag2 directory of sensor_msgs/JointState topics.

    Parameters
    ----------
    path : Path or str
        Directory to create; an existing one is never overwritten.
    content : Record, iterable or mapping of JointStream
        A record is written to the topics ``joint_command``, ``joint_states``, ``reference``, ``excitation``,
        ``conditions``.
    custom : mapping of str to str, optional
        Text stored with the bag's metadata.
    storage : {"mcap", "sqlite3"}
        Storage format.

    Returns
    -------
    Path
        The bag's directory.

    Raises
    ------
    InputError
        `path` exists, cannot be created, or there is nothing to write.
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
    streams.sort(key=lambda stream: _rank(stream.topic))
    typestore = get_typestore(Stores.ROS2_JAZZY)
    when = np.concatenate([stream.receive_ns for stream in streams])
    whose = np.repeat(np.arange(len(streams)), [len(stream) for stream in streams])
    which = np.concatenate([np.arange(len(stream)) for stream in streams])
    order = np.argsort(when, kind="stable")
    tables = [_payloads(stream) for stream in streams]
    try:
        with Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()]) as writer:
            for key, text in (_units_of(content) | dict(custom or {})).items():
                writer.set_custom_data(key, text)
            connections = [
                writer.add_connection("/" + stream.topic.removeprefix("/"), JOINT_STATE, typestore=typestore)
                for stream in streams
            ]
            for stream, row, at in zip(whose[order].tolist(), which[order].tolist(), when[order].tolist(), strict=True):
                writer.write(connections[stream], at, tables[stream][row])
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    return path


def _units_of(content: object) -> dict[str, str]:
    """Units of the conditions of a record for the metadata of the bag; no model states them."""
    if not isinstance(content, Record) or not content.conditions:
        return {}
    return {CONDITION_UNITS: json.dumps({one.name: one.unit for one in content.conditions})}


def _rank(topic: str) -> int:
    name = topic.rsplit("/", 1)[-1]
    return _ORDER.index(name) if name in _ORDER else len(_ORDER)


def _payloads(stream: JointStream) -> list[bytes]:
    values = [getattr(stream, field) for field in FIELDS]
    # A field that no message carries stays an empty sequence, as ROS has it for "not available".
    position, velocity, effort = (None if np.isnan(value).all() else value for value in values)
    rows = encode_rows(stream.names, stream.stamp_ns, (position, velocity, effort))
    size = rows.shape[1]
    joined = rows.tobytes()
    return [joined[start : start + size] for start in range(0, len(joined), size)]


def record_streams(record: Record) -> list[JointStream]:
    """Return a record as the streams of our topics: command, measurement, reference, excitation, conditions."""
    joint, _, field = record.input_name.rpartition(".")
    streams = [make_stream("joint_command", record.absolute(record.input_time), {joint: {field: record.input}})]
    measured: dict[str, dict[str, Array]] = {}
    for name, values in zip(record.output_names, record.output.T, strict=True):
        output_joint, _, output_field = name.rpartition(".")
        measured.setdefault(output_joint, {})[output_field] = values
    streams.append(make_stream("joint_states", record.absolute(record.time), measured))
    if record.reference is not None and record.reference_time is not None:
        fields = {"position": record.reference[:, 0], "velocity": record.reference[:, 1]}
        streams.append(make_stream("reference", record.absolute(record.reference_time), {joint: fields}))
    if record.excitation is not None and record.excitation_time is not None:
        fields = {"position": record.excitation[:, 0], "effort": record.excitation[:, 1]}
        streams.append(make_stream("excitation", record.absolute(record.excitation_time), {joint: fields}))
    if record.conditions:
        stamps, columns = conditions_columns(record.conditions, record.start_ns)
        streams.append(make_stream(CONDITIONS, stamps, {name: {FIELD: value} for name, value in columns.items()}))
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
