"""Names of columns that hold stamps, and the unit that a name says."""

from __future__ import annotations

import re
from typing import Any

from idloop.records.tables.base_units import SECONDS, known_unit

TIME_WORDS = frozenset({
    "t", "time", "times", "timestamp", "timestamps", "stamp", "stamps", "timevec", "tout", "zeit", "clock", "elapsed",
    "elapsedtime", "sec", "seconds", "millis", "micros", "millisec", "microsec", "timeseconds", "datetime",
    "tiempo", "tempo", "tijd",
})  # fmt: skip
# What may stand before a time: which clock, or since when.
_WHICH = re.compile(
    r"(?:elapsed|relative|absolute|receive|received|log|recorded|sample|local|utc|unix|system)[\s_]+(?=time)"
)
_BEHIND = re.compile(r"^(.*?)[\s_.\-]*[\[(<]?([a-zµμ]+)[\])>]?$")


def clock_unit(name: str) -> str | None:
    """Return the unit of a column of stamps: s, ms, us or ns, "" where its name has none; None for other columns.

    `name`: ``t``, ``Time``, ``timestamp_us``, ``time [ms]``.
    """
    text = _WHICH.sub("", name.strip().strip("_").lower(), count=1)
    if text in TIME_WORDS:
        # A name such as `millis` is a unit itself.
        return "s" if text == "timeseconds" else known_clock_unit(text)
    match = _BEHIND.match(text)
    if match and match[1].strip() in TIME_WORDS and text[len(match[1])] in " _.-[(<":
        return known_clock_unit(match[2]) or None
    return None


def known_clock_unit(text: str) -> Any:
    """Return a unit of stamps as a mapping file writes it; empty for another unit."""
    unit = known_unit(text.strip().strip("[]()<>").lower())
    return unit if unit in SECONDS else ""
