"""Runs of the clock: a bag in which simulated time started anew holds several experiments."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from idloop.records.clocks import stamp_statistics
from idloop.records.stream import JointStream

Stamps = NDArray[np.int64]


def on_receive_time(stream: JointStream) -> JointStream:
    """Return the stream with its receive times in place of the stamps."""
    return _take(stream, slice(None), stream.receive_ns)


def _take(stream: JointStream, rows: slice | NDArray[np.int64], stamp_ns: Stamps | None = None) -> JointStream:
    return JointStream(
        stream.topic,
        (stream.stamp_ns if stamp_ns is None else stamp_ns)[rows],
        stream.receive_ns[rows],
        stream.names,
        stream.position[rows],
        stream.velocity[rows],
        stream.effort[rows],
        stream.type,
        stream.stamped,
        stream.findings,
    )


def split_runs(stream: JointStream) -> list[JointStream]:
    """Split a stream where its clock was set back."""
    edges = [0, *stamp_statistics(stream.stamp_ns).resets, len(stream)]
    return [_take(stream, slice(start, stop)) for start, stop in pairwise(edges)]


def backwards_message(path: Path, streams: Mapping[str, JointStream], resets: Mapping[str, list[JointStream]]) -> str:
    """Say where time runs backwards and what to do about it."""
    topic, parts = next(iter(resets.items()))
    at = len(parts[0])
    stamp = streams[topic].stamp_ns
    back = float(stamp[at - 1] - stamp[at]) * 1e-9
    return (
        f"{path}: time runs backwards on {topic} (message {at} of {len(streams[topic])}: {back:.6g} s back; clock"
        " set back "
        f"{len(parts) - 1} times); record one run per bag, or read the runs apart with read_records(split=True)"
    )
