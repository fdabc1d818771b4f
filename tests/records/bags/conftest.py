"""What the tests of bags share: recordings of ROS 1."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from idloop.records.bags.stream import JOINT_STATE


@pytest.fixture
def ros1_bag() -> Callable[..., Path]:
    """Write a bag of ROS 1: ``/joint_states`` of a joint ``j`` at k/8, ``/u`` at k/4."""

    def write(path: Path, compression: Any = None, count: int = 40) -> Path:
        from rosbags.rosbag1 import Writer as Ros1Writer
        from rosbags.typesys import Stores, get_typestore

        store = get_typestore(Stores.ROS1_NOETIC)
        types = store.types
        writer = Ros1Writer(path)
        if compression is not None:
            writer.set_compression(compression)
        with writer:
            states = writer.add_connection("/joint_states", JOINT_STATE, typestore=store)
            command = writer.add_connection("/u", "std_msgs/msg/Float64", typestore=store)
            empty = np.zeros(0)
            for k in range(count):
                header = types["std_msgs/msg/Header"](k, types["builtin_interfaces/msg/Time"](0, k + 1), "base")
                state = types[JOINT_STATE](header, ["j"], np.array([k / 8]), empty, empty)
                writer.write(states, 10**18 + k, store.serialize_ros1(state, JOINT_STATE))
                number = types["std_msgs/msg/Float64"](k / 4)
                writer.write(command, 10**18 + k, store.serialize_ros1(number, "std_msgs/msg/Float64"))
        return path

    return write
