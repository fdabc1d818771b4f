"""Which clock stamped a topic, seen from the clock of the recorder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from idloop.records.bags.stream import JointStream

_FIRST_DATE_NS = 10**18  # 2001-09-09: earlier stamps count from a start, not from 1970


@dataclass(frozen=True)
class StampClock:
    """Clock of the stamps of one topic."""

    topic: str
    # ``recorder``: the messages carry no stamps, receive times stand for them. ``date``: seconds since 1970, as by the
    # clock of a computer. ``start``: seconds since a start, as in simulated time, while the recorder has dates.
    source: Literal["recorder", "date", "start"]
    offset: float  # median of stamp minus receive time [s]
    spread: float  # range of stamp minus receive time over the middle 90 % of the messages [s]
    speed: float  # seconds of the stamps per second of the recorder; 1 in real time, NaN where all came at once


def stamp_clock(stream: JointStream) -> StampClock:
    """Describe the clock that stamped a topic."""
    ahead = (stream.stamp_ns - stream.receive_ns) * 1e-9
    low, high = np.quantile(ahead, (0.05, 0.95))
    received = float(np.ptp(stream.receive_ns)) * 1e-9
    counted = bool(np.median(stream.stamp_ns) < _FIRST_DATE_NS <= np.median(stream.receive_ns))
    return StampClock(
        topic=stream.topic,
        source="recorder" if not stream.stamped else "start" if counted else "date",
        offset=float(np.median(ahead)),
        spread=float(high - low),
        speed=float(np.ptp(stream.stamp_ns)) * 1e-9 / received if received > 0 else float("nan"),
    )


def share_no_clock(first: JointStream, second: JointStream) -> bool:
    """Whether one topic has dates and the other counts from a start, as with simulated time beside receive time."""
    sources = {stamp_clock(one).source for one in (first, second)}
    return "start" in sources and len(sources) > 1
