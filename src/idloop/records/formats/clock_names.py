"""Names of columns that hold stamps, and the unit that a name says."""

from __future__ import annotations

import re
from typing import Literal

_NAMES = frozenset({
    "t", "time", "times", "timestamp", "timestamps", "stamp", "stamps", "timevec", "tout", "zeit", "elapsed",
    "elapsedtime", "seconds", "millis", "micros", "millisec", "microsec", "timeseconds",
})  # fmt: skip
_UNITS: dict[str, Literal["s", "ms", "us", "ns"]] = {
    "s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "msec": "ms", "millis": "ms", "milliseconds": "ms",
    "us": "us", "usec": "us", "micros": "us", "microseconds": "us", "µs": "us", "μs": "us", "ns": "ns", "nsec": "ns",
    "nanoseconds": "ns",
}  # fmt: skip
_SAYS_ITSELF = {"millis": "ms", "millisec": "ms", "micros": "us", "microsec": "us", "seconds": "s", "timeseconds": "s"}
_BEHIND = re.compile(r"^(.*?)[\s_.\-]*[\[(<]?([a-zµμ]+)[\])>]?$")


def clock_unit(name: str) -> str | None:
    """Return the unit of a column of stamps: s, ms, us or ns, "" where its name has none; None for other columns.

    Parameters
    ----------
    name : str
        ``t``, ``Time``, ``timestamp_us``, ``time [ms]``.
    """
    text = name.strip().strip("_").lower()
    if text in _NAMES:
        return _SAYS_ITSELF.get(text, "")
    match = _BEHIND.match(text)
    if match and match[1].strip() in _NAMES and match[2] in _UNITS and text[len(match[1])] in " _.-[(<":
        return _UNITS[match[2]]
    return None


def known_clock_unit(text: str) -> Literal["s", "ms", "us", "ns", ""]:
    """Return a unit of stamps as a mapping file writes it; empty for another unit."""
    return _UNITS.get(text.strip().strip("[]()<>").lower(), "")
