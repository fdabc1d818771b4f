"""Messages as `ros2 topic echo` and `rostopic echo` print them: YAML documents of one form, line by line.

A reader of YAML takes a millisecond for a message; of what these programs print, the indentation says everything.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from idloop.documents import MOST_JSON_TABLE, read_text
from idloop.errors import InputError
from idloop.records.formats.form import Form, Options, text_of
from idloop.records.formats.json_file import table_of_samples
from idloop.records.tables.table import Table

_END = "---"
_KEY = re.compile(r"([^\W\d]\w*):(?:\s+(.*))?")
_MOST_ENTRIES = 64  # of a list that become columns


def read_echo(path: Path, _: Options) -> Table:
    """Read the messages of a file; a last one without its end is left out."""
    messages, lines = [], list[str]()
    for line in read_text(path, MOST_JSON_TABLE).splitlines():
        if line.strip() != _END:
            lines.append(line)
            continue
        if found := dict(_values(lines)):
            messages.append(found)
        lines = []
    if not messages:
        raise InputError(f"{path}: no message is whole; check that the recording was saved")
    table = table_of_samples(path, messages)
    if any(line.strip() for line in lines):
        table.notes.append("the last message is cut off and left out")
    return table


def _values(lines: list[str]) -> Iterator[tuple[str, float | str]]:
    """Yield the values of a message by their paths, as ``header.stamp.sec`` and ``position[0]``."""
    # Keys and entries within which a line stands: their indentation and name.
    inside: list[tuple[int, str]] = []
    entries: Counter[str] = Counter()
    for line in lines:
        body = line.strip()
        depth = len(line) - len(line.lstrip())
        if body == "-" or body.startswith("- "):
            while inside and (inside[-1][0] > depth or (inside[-1][0] == depth and inside[-1][1].startswith("["))):
                inside.pop()
            place = _path(inside)
            inside.append((depth, f"[{entries[place]}]"))
            entries[place] += 1
            body, depth = body[1:].strip(), depth + 2
        match = _KEY.fullmatch(body)
        if match is None:
            if body and inside and entries[_path(inside[:-1])] <= _MOST_ENTRIES:
                yield _path(inside), _value(body)
            continue
        while inside and inside[-1][0] >= depth:
            inside.pop()
        inside.append((depth, match[1]))
        written = (match[2] or "").strip()
        if written.startswith("["):
            cells = [cell.strip() for cell in written.strip("[]").split(",")]
            for number, cell in enumerate(cells[:_MOST_ENTRIES]):
                if cell:
                    yield f"{_path(inside)}[{number}]", _value(cell)
        elif written:
            yield _path(inside), _value(written)


def _path(inside: list[tuple[int, str]]) -> str:
    return "".join(name if name.startswith("[") else f".{name}" for _, name in inside).removeprefix(".")


def _value(text: str) -> float | str:
    try:
        return float(text.removeprefix(".")) if text in (".nan", ".inf") else float(text)
    except ValueError:
        return text.strip("'\"")


def _is_echo(head: bytes) -> bool:
    """Whether a text has documents that begin with the same key."""
    documents = re.split(rf"^{_END}\s*$", text_of(head), flags=re.MULTILINE)[:3]
    first = [_KEY.fullmatch(one.strip().split("\n", 1)[0].strip()) for one in documents if one.strip()]
    keys = [match[1] for match in first if match is not None]
    return len(documents) > 1 and len(keys) == len(first) > 1 and len(set(keys)) == 1


FORM = Form(
    "echo",
    (),
    "messages as `ros2 topic echo` and `rostopic echo` print them",
    "values of a message by their paths: `header.stamp.sec`, `position[0]`",
    _is_echo,
    read_echo,
)
