"""What the tests of records share: a model's signals, a record with motion in it, raw messages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from idloop.records import Record, make_stream, write_bag

START = 1_700_000_000_000_000_000


@dataclass(frozen=True)
class Signal:
    topic: str
    joint: str
    field: str
    unit: str
    kind: str = "held"


@pytest.fixture
def model() -> SimpleNamespace:
    """Signals of a motor with measured position and velocity."""
    return SimpleNamespace(
        input=Signal("joint_command", "motor", "effort", "V"),
        outputs=[
            Signal("joint_states", "motor", "position", "rad"),
            Signal("joint_states", "motor", "velocity", "rad/s"),
        ],
        conditions=(),
    )


@pytest.fixture
def record() -> Record:
    """Two seconds at 1 kHz: random steps into a lag."""
    rng = np.random.default_rng(3)
    time = np.arange(2000) / 1000
    command = np.repeat(rng.normal(size=40), 50)
    velocity = np.convolve(command, np.exp(-np.arange(400) / 80) / 80)[:2000]
    position = np.cumsum(velocity) * 1e-3
    pair = np.column_stack([position, velocity])
    return Record(
        "lag",
        time,
        command,
        time,
        pair,
        "motor.effort",
        "V",
        ("motor.position", "motor.velocity"),
        ("rad", "rad/s"),
        reference_time=time,
        reference=pair + 0.1,
        excitation_time=time[::2],
        excitation=np.column_stack([np.full(1000, np.nan), command[::2]]),
        start_ns=START,
    )


@pytest.fixture
def bag(tmp_path: Path, record: Record) -> Path:
    return write_bag(tmp_path / "bag", record)


@pytest.fixture
def make_bag(tmp_path: Path) -> Callable[..., Path]:
    """Write a bag from stamps [s] and values, with defaults for what a test does not care about."""

    def make(
        time: Any = None,
        command: Any = None,
        position: Any = None,
        velocity: Any = None,
        command_time: Any = None,
        receive: Any = None,
        command_receive: Any = None,
    ) -> Path:
        def stamps(seconds: Any) -> Any:
            return None if seconds is None else START + np.round(np.asarray(seconds) * 1e9).astype(np.int64)

        time = np.arange(200) / 100 if time is None else np.asarray(time, dtype=float)
        command_time = time if command_time is None else np.asarray(command_time, dtype=float)
        command = np.sign(np.sin(7 * np.arange(command_time.size))) if command is None else command
        position = np.sin(np.arange(time.size) / 10) if position is None else position
        velocity = 10.0 * np.cos(np.arange(time.size) / 10) if velocity is None else velocity
        # Received one after the other, whatever the stamps say.
        receive = np.arange(time.size) * 0.01 if receive is None and np.any(np.diff(time) < 0) else receive
        if command_receive is None and np.any(np.diff(command_time) < 0):
            command_receive = np.arange(command_time.size) * 0.01
        path = tmp_path / f"made{len(list(tmp_path.iterdir()))}"
        return write_bag(
            path,
            [
                make_stream(
                    "joint_command", stamps(command_time), {"motor": {"effort": command}}, stamps(command_receive)
                ),
                make_stream(
                    "joint_states",
                    stamps(time),
                    {"motor": {"position": position, "velocity": velocity}},
                    stamps(receive),
                ),
            ],
        )

    return make


@pytest.fixture
def typestore() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


@pytest.fixture
def write_messages(typestore: Any) -> Callable[..., Path]:
    """Write (topic, type, [(receive_ns, message), ...]) with rosbags itself, as other tools do."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    def write(
        path: Path, topics: list[tuple[str, str, list[tuple[int, Any]]]], storage: str = "MCAP", store: Any = None
    ) -> Path:
        types = store or typestore
        with Writer(path, version=9, storage_plugin=StoragePlugin[storage]) as writer:
            for topic, kind, messages in topics:
                connection = writer.add_connection(topic, kind, typestore=types)
                for receive, message in messages:
                    writer.write(connection, receive, types.serialize_cdr(message, kind))
        return path

    return write


@pytest.fixture
def joint_state(typestore: Any) -> Callable[..., Any]:
    """Build one JointState message."""

    def build(
        stamp_ns: int, names: Any, position: Any = (), velocity: Any = (), effort: Any = (), frame: str = ""
    ) -> Any:
        types = typestore.types
        stamp = types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 1_000_000_000))
        return types["sensor_msgs/msg/JointState"](
            types["std_msgs/msg/Header"](stamp, frame),
            list(names),
            np.array(position, dtype=float),
            np.array(velocity, dtype=float),
            np.array(effort, dtype=float),
        )

    return build
