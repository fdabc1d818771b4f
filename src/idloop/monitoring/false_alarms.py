"""Time between two false alarms, written as text: "1000 h", "per 30 days"."""

from __future__ import annotations

import re

from idloop.errors import InputError

HOURS = {"s": 1.0 / 3600.0, "min": 1.0 / 60.0, "h": 1.0, "d": 24.0, "day": 24.0, "days": 24.0, "week": 168.0}
HOURS |= {"weeks": 168.0, "year": 8766.0, "years": 8766.0}
# Running time: half a year of day shifts.
USUAL_HOURS = 1000.0

_FORM = re.compile(r"(?:(?:1|one)?\s*per\s+)?([0-9.eE+]+)?\s*([a-z]+)", re.IGNORECASE)


def parse_false_alarms(text: str) -> float:
    """Mean running time between two false alarms.

    `text`: ``per 1000 h``, ``1000 h``, ``per year``; the units are s, min, h, days, weeks, years. Returns: positive
    [h]. Raises InputError: it is not of that form.
    """
    found = _FORM.fullmatch(text.strip())
    try:
        count = float(found.group(1) or 1.0) if found else 0.0
    except ValueError:
        count = 0.0
    unit = found.group(2).lower() if found else ""
    if unit not in HOURS or not 0.0 < count < float("inf"):
        raise InputError(
            f"false alarms {text!r}: write the running time between two of them, such as 'per 1000 h' or 'per 30 days'"
        )
    return count * HOURS[unit]
