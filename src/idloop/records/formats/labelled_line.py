"""One line of labelled values: of a serial plotter, of a console log with a clock before them, or of Teleplot."""

from __future__ import annotations

import re
from dataclasses import dataclass

from idloop.records.tables.base_units import known_unit

_NUMBER = r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|nan|inf(?:inity)?)"
_PAIR = re.compile(rf"([^\W\d][^:=,;|\t]*?)\s*[:=]\s*({_NUMBER})\s*§?\s*([^\s\d:=,;|.+-]\S*)?", re.IGNORECASE)
# A label with something else than a number, such as `state=RUN`.
_TEXT = re.compile(r"[^\W\d][^\s:=,;|]*\s*[:=]\s*\S+")
_CELLS = re.compile(r"\s*[,;\t|]\s*")
_BLANKS = re.compile(r"\s+(?=[^\W\d][^\s:=]*\s*[:=])")
# Before the values, what says most of the time first; then numbers in brackets, and others.
_CLOCK = r"\d{1,2}:\d\d:\d\d(?:[.,:]\d+)?"
_STAMPS = tuple(map(re.compile, (
    rf"(?P<stamp>\d{{4}}-\d\d-\d\d[T ]{_CLOCK}(?:Z|[-+]\d\d:?\d\d)?)(?P<unit>)",
    rf"(?P<stamp>{_CLOCK})(?P<unit>)",
    r"[\[(]\s*(?P<stamp>\d+(?:\.\d+)?)\s*(?P<unit>[mµun]?s)?\s*[\])]",
    r"(?:^|(?<![:=\s])\s+)(?P<stamp>\d+(?:\.\d+)?)\s*(?P<unit>[mµun]?s)?(?=[\s,;:|>])",
)))  # fmt: skip
# Of a dictionary as Python prints it.
_MARKS = str.maketrans("", "", "{}'\"")
# Of Teleplot: `>name:value`, `>name:stamp:value§unit|flags`, several values apart by semicolons; stamps are in ms.
_TELEPLOT = re.compile(r">\s*([^:|]+):([^|§]+)(?:§([^|]*))?(?:\|(\w*))?")
_NO_SERIES = ("t", "xy")


@dataclass(frozen=True)
class Reading:
    """One value."""

    label: str
    value: float
    # When it was taken, and the unit of that; empty where the line does not say it
    stamp: str = ""
    clock: str = ""
    unit: str = ""  # as the line writes it


def readings(line: str) -> list[Reading]:
    """Return the values of a line; none where something else stands among them, or a label twice.

    Parameters
    ----------
    line : str

    Examples
    --------
    >>> [(one.label, one.value, one.stamp) for one in readings("[09:00:00.5] INFO motor: pos=1.2 vel=0.3")]
    [('pos', 1.2, '09:00:00.5'), ('vel', 0.3, '09:00:00.5')]
    """
    text = line.translate(_MARKS).strip()
    if text.startswith(">"):
        return _teleplot(text) or _pairs(text[1:])
    for form in _STAMPS:
        match = form.search(text)
        if match is None or _pairs(text[: match.start()]):
            continue
        stamp, clock = match["stamp"].replace(",", "."), (match["unit"] or "").replace("µ", "u")
        if found := _pairs(text[match.end() :].lstrip(" \t])>|:;,-")):
            return [Reading(one.label, one.value, stamp, clock, one.unit) for one in found]
    return _pairs(text)


def _pairs(text: str) -> list[Reading]:
    """Values behind labels; what stands before the first of them does not count."""
    head, *cells = map(str.strip, _CELLS.split(text.rstrip(",;| \t")))
    parts = [*([head] if _PAIR.fullmatch(head) and cells else _BLANKS.split(head)), *cells]
    words = len(parts) - len(cells) - bool(cells)  # that may stand before the first of them
    found: dict[str, Reading] = {}
    for place, part in enumerate(parts):
        match = _PAIR.fullmatch(part)
        if match is None or (match[3] and not known_unit(match[3])):
            if (found or place >= words) and not _TEXT.fullmatch(part):
                return []
            continue
        if match[1] in found:
            return []
        found[match[1]] = Reading(match[1], float(match[2]), unit=match[3] or "")
    return list(found.values())


def _teleplot(text: str) -> list[Reading]:
    match = _TELEPLOT.fullmatch(text)
    if match is None or match[4] in _NO_SERIES:
        return []
    found = []
    for point in match[2].split(";"):
        *stamp, value = map(str.strip, point.split(":"))
        if len(stamp) > 1 or not all(re.fullmatch(_NUMBER, one, re.IGNORECASE) for one in (*stamp, value)):
            return []
        found.append(Reading(match[1], float(value), "".join(stamp), "ms" if stamp else "", match[3] or ""))
    return found
