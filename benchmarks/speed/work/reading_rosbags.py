"""All joint topics of a bag as arrays, message by message through rosbags' AnyReader."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

FIELDS = ("position", "velocity", "effort")


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Stamps and the three fields of each topic; what a message leaves out is NaN."""
    types = get_typestore(Stores.ROS2_JAZZY)

    def act() -> dict[str, Any]:
        stamps: dict[str, list[int]] = {}
        values: dict[str, list[Any]] = {}
        with AnyReader([Path(settings["bag"])], default_typestore=types) as reader:
            for connection, _, raw in reader.messages():
                message: Any = reader.deserialize(raw, connection.msgtype)
                topic, stamp = connection.topic.strip("/"), message.header.stamp
                stamps.setdefault(f"{topic}.stamp", []).append(stamp.sec * 1_000_000_000 + stamp.nanosec)
                for name in FIELDS:
                    numbers = getattr(message, name)
                    filled = numbers if len(numbers) else np.full(len(message.name), np.nan)
                    values.setdefault(f"{topic}.{name}", []).append(filled)
        return {key: np.array(value, dtype=np.int64) for key, value in stamps.items()} | {
            key: np.array(value, dtype=float) for key, value in values.items()
        }

    return act
