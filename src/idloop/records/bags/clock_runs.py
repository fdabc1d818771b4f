"""Runs of the clock: a bag in which simulated time was restarted holds several experiments."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from idloop.arrays import Integers
from idloop.records.bags.stream import JointStream
from idloop.records.inspection.clocks import stamp_statistics


def split_runs(stream: JointStream) -> list[JointStream]:
    """Split a stream where its clock was set back."""
    edges = [0, *stamp_statistics(stream.stamp_ns).resets, len(stream)]
    return [stream.take(slice(start, stop)) for start, stop in pairwise(edges)]


def announced_runs(stream: JointStream, runs: int) -> list[JointStream]:
    """Split a stream of values that are sent ahead of their time, and may be replaced, into runs of the clock.

    A message replaces all earlier ones with its stamp or a later one, as in the nodes. Where the stamps go back more
    often than the clock was reset, the largest steps back are taken as the resets.

    `runs`: runs of the clock of the measured topics; fewer are returned where the stream has fewer.
    """
    stamp = stream.stamp_ns
    back = np.array(stamp_statistics(stamp).resets, dtype=np.int64)
    clock = np.sort(back[np.argsort(stamp[back] - stamp[back - 1], kind="stable")[: runs - 1]])
    parts = [stream.take(slice(start, stop)) for start, stop in pairwise([0, *clock.tolist(), len(stream)])]
    return [part.take(_last_announced(part.stamp_ns)) for part in parts]


def _last_announced(stamp: Integers) -> Integers:
    """Return the rows that no later message replaces."""
    later = np.append(np.minimum.accumulate(stamp[::-1])[::-1][1:], np.iinfo(np.int64).max)
    return np.flatnonzero(stamp < later)


def backwards_message(path: Path, streams: Mapping[str, JointStream], resets: Mapping[str, list[JointStream]]) -> str:
    """Return where time runs backwards, and what to do."""
    topic, parts = next(iter(resets.items()))
    at = len(parts[0])
    stamp = streams[topic].stamp_ns
    back = float(stamp[at - 1] - stamp[at]) * 1e-9
    return (
        f"{path}: time runs backwards on {topic} (message {at} of {len(streams[topic])}: {back:.6g} s back; the clock"
        f" was set back {len(parts) - 1} times); record one run per bag, or read the runs apart with"
        " read_records(split=True)"
    )
