"""All joint topics of a bag as arrays, by idloop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from idloop.records import read_streams

FIELDS = ("position", "velocity", "effort")


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Stamps and the three fields of each topic."""

    def act() -> dict[str, Any]:
        found = {}
        for topic, stream in read_streams(settings["bag"]).items():
            found[f"{topic.strip('/')}.stamp"] = stream.stamp_ns
            for name in FIELDS:
                found[f"{topic.strip('/')}.{name}"] = getattr(stream, name)
        return found

    return act
