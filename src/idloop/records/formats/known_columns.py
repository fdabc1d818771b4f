"""Columns of known drives, whose logs say no units: typed entries, and the drive that a log is of."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from itertools import chain

from pydantic import BaseModel, ConfigDict, Field

from idloop.documents import read_yaml
from idloop.records.recognition.column_name import BRACKETS
from idloop.records.recognition.roles import Signal
from idloop.records.tables.mapping import Decoding

_BEHIND_INDEX = re.compile(r"[_ ]?\d+$")


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class KnownColumn(_Strict):
    """What a column is: value = decode(raw) * scale / divide_by + offset, in `unit`."""

    role: Signal  # signal of a mapping file that it is
    unit: str  # as a mapping file writes it
    scale: float = 1.0
    offset: float = 0.0
    decode: Decoding | None = None
    wrap: float | None = None  # range after which it starts again, in `unit`
    # Number that only the user knows, by which it is divided as well, such as ``pole pairs``; empty without one
    divide_by: str = ""
    note: str = ""  # what is uncertain about it


class KnownDevice(_Strict):
    """The columns of one drive's logs."""

    device: str
    source: str = Field(min_length=1)  # manual that its figures are from
    match: list[list[str]] = Field(min_length=1)  # sets of columns, of which one must be there
    columns: dict[str, KnownColumn]  # by the name that `plain_name` makes of a column's

    def known(self, columns: Iterable[str]) -> dict[str, KnownColumn]:
        """Return those columns of a log that this drive has, by their names in the log."""
        plain = {name: plain_name(name) for name in columns}
        return {name: self.columns[short] for name, short in plain.items() if short in self.columns}


@cache
def known_columns() -> tuple[KnownDevice, ...]:
    """Return all drives whose columns are known."""
    path = files("idloop.records.formats") / "known_columns.yaml"
    content = read_yaml(path.read_text(encoding="utf-8"), str(path))
    return tuple(KnownDevice.model_validate(entry) for entry in content)


def recognise(columns: Iterable[str]) -> KnownDevice | None:
    """Return the drive of a log with such columns as ``axis0.encoder.pos_estimate``; None where it is unknown."""
    names = {plain_name(name) for name in columns}
    best: tuple[int, int, KnownDevice] | None = None
    for device in known_columns():
        matched = max((len(several) for several in device.match if names.issuperset(several)), default=0)
        found = len(names & device.columns.keys())
        if matched and (best is None or (matched, found) > best[:2]):
            best = (matched, found, device)
    return best[2] if best else None


def plain_name(name: str) -> str:
    """Return a column's name in small letters, without what leads to it, its unit in brackets and an index behind it.

    Examples
    --------
    >>> plain_name("axis0/encoder.pos_estimate"), plain_name("Present Position 2")
    ('pos_estimate', 'present_position')
    """
    text = BRACKETS.sub("", name).strip().lower()
    text = re.split(r"[/.:]", text)[-1].strip()
    known = {name for device in known_columns() for name in (*device.columns, *chain.from_iterable(device.match))}
    for one in (text, text.replace(" ", "_").replace("-", "_")):
        for short in (one, _BEHIND_INDEX.sub("", one)):
            if short in known:
                return short
    return text
