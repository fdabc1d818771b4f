"""Runs of the clock: a bag in which simulated time started anew holds several experiments."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from idloop.records.bags.stream import JointStream
from idloop.records.inspection.clocks import stamp_statistics

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


def announced_runs(stream: JointStream, runs: int) -> list[JointStream]:
    """Split a stream whose sender announces values ahead, and may take them back, into as many runs of the clock.

    A value announced anew replaces everything from its stamp on, as the nodes read it. Where the stamps go back more
    often than the clock did, the largest steps are the clock's.

    Parameters
    ----------
    stream : JointStream
    runs : int
        Runs of the clock that the measured topics tell of; fewer are returned where the stream has fewer.
    """
    stamp = stream.stamp_ns
    back = np.array(stamp_statistics(stamp).resets, dtype=np.int64)
    clock = np.sort(back[np.argsort(stamp[back] - stamp[back - 1], kind="stable")[: runs - 1]])
    parts = [_take(stream, slice(start, stop)) for start, stop in pairwise([0, *clock.tolist(), len(stream)])]
    return [_take(part, _stands(part.stamp_ns)) for part in parts]


def _stands(stamp: Stamps) -> NDArray[np.int64]:
    """Return the rows after which nothing of their stamp or before was announced."""
    later = np.append(np.minimum.accumulate(stamp[::-1])[::-1][1:], np.iinfo(np.int64).max)
    return np.flatnonzero(stamp < later)


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
