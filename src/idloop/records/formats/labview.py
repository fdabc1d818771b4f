"""LabVIEW measurement files: a head that says how the table below it is written."""

from __future__ import annotations

import re
from pathlib import Path

from idloop.documents import MOST_TABLE
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, text_of
from idloop.records.formats.text_table import read_text_table
from idloop.records.tables.table import Table

_UNITS = "Y_Unit_Label"
_BEGIN, _END = "LabVIEW Measurement", "***End_of_Header***"
# Lines of the head of the file and of that of its table.
_MOST_LINES = 1_000
_DELIMITERS = {"tab": "\t", "comma": ","}
_KEY = re.compile(r"(\w+)[\t,]\s*(\S*)")
_TIME = re.compile(r"^X_Dimension\W+Time\b", re.MULTILINE)


def read_labview(path: Path, options: Options) -> Table:
    """Read the columns of a file with one segment.

    Source: National Instruments, *Specification for the LabVIEW Measurement File (.lvm)*.

    Raises InputError: it has no such head, several segments, or a damaged table.
    """
    if path.stat().st_size > MOST_TABLE:
        raise InputError(f"{path}: the file has more than {MOST_TABLE >> 30} GiB; keep fewer rows")
    above: list[str] = []
    ends: list[int] = []
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as stream:
        for line in stream:
            # Those that the reader of tables passes over are not counted.
            if line.strip() and not line.lstrip().startswith(("#", "%")):
                above.append(line.strip("\r\n"))
            if line.startswith(_END):
                ends.append(len(above))
            if len(above) > _MOST_LINES:
                break
    if not ends:
        raise InputError(f"{path}: no {_END} in its first {_MOST_LINES:,} lines; check that this is a LabVIEW file")
    if len(above) == ends[-1]:
        raise InputError(f"{path}: there is no table below its head; check that the recording was saved whole")
    if len(ends) > 2:
        raise InputError(f"{path}: it holds {len(ends) - 1} segments; save each in a file of its own")
    head = above[: ends[-1]]
    said = {match[1]: match[2] for line in head if (match := _KEY.match(line))}
    delimiter = _DELIMITERS.get(said.get("Separator", "").lower(), "\t")
    # The rows have no cell for the last name, Comment, where there is none.
    names = [name.strip() for name in above[ends[-1]].split(delimiter)]
    own = {
        "skip_rows": ends[-1] + 1,
        "header": False,
        "delimiter": delimiter,
        "decimal": "," if said.get("Decimal_Separator") == "," else ".",
    }
    table = read_text_table(path, {**options, **own})
    if len(table.columns) <= len(names) == len(set(names)):
        table.columns = dict(zip(names, table.columns.values(), strict=False))
    clock = "X_Value"
    if clock in table.columns and _TIME.search("\n".join(head)):
        table.units[clock] = "s"
        channels = [name for name in table.columns if name not in (clock, "Comment")]
        table.units |= {name: unit for name, unit in zip(channels, _units(head, delimiter), strict=False) if unit}
        table.clocks = dict.fromkeys(channels, clock)
    return table


def _units(head: list[str], delimiter: str) -> list[str]:
    """Units of the channels, in their order."""
    rows = (line.split(delimiter) for line in head)
    return next(([cell.strip() for cell in row[1:]] for row in rows if row[0].strip() == _UNITS), [])


FORM = Form(
    "lvm",
    (".lvm",),
    "LabVIEW measurement file",
    "by the header; `X_Value` holds the stamps [s] of the others",
    lambda head: text_of(head).startswith(_BEGIN),
    read_labview,
)
