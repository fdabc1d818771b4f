"""Numbers inside messages of any known type, as named columns."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array, Integers

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_NUMBERS = {"float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "bool"}
_BYTES = {"uint8", "int8", "byte", "char", "octet", "bool"}
_SKIPPED = {
    "std_msgs/msg/Header",
    "builtin_interfaces/msg/Time",
    "builtin_interfaces/msg/Duration",
    "std_msgs/msg/MultiArrayLayout",
}
_LONGEST = 64  # longer arrays are images, scans or maps, not signals of an axis

Kinds = Mapping[str, Any]


@dataclass(frozen=True)
class _Part:
    """One part of a type.

    `kind` is number, numbers (an array), names (an array of texts), text, named (a sequence of messages, each with
    names and numbers of its own), or bulk (anything else of any length); `inner` are the names and numbers of `named`.
    """

    path: str
    kind: str
    inner: tuple[str, str] = ("", "")


def carries_signals(fields: Kinds, name: str) -> bool:
    """Whether a type, by its definition, holds numbers of an axis rather than images, maps or text."""
    parts = list(_parts(fields, name))
    kinds = {part.kind for part in parts}
    if "named" in kinds or ("numbers" in kinds and any(part.kind == "names" for part in parts)):
        return True
    return bool(kinds & {"number", "numbers"}) and "bulk" not in kinds


def _parts(fields: Kinds, name: str, prefix: str = "") -> Iterator[_Part]:
    from rosbags.interfaces import Nodetype

    for own, (node, args) in fields[name][1]:
        path = prefix + own
        if node == Nodetype.BASE:
            yield _Part(path, "number" if args[0] in _NUMBERS else "text")
        elif node == Nodetype.NAME:
            yield from () if args in _SKIPPED else _parts(fields, args, path + ".")
        else:
            item_node, item = args[0]
            if item_node == Nodetype.NAME:
                yield _named(fields, item, path)
            elif node == Nodetype.SEQUENCE and item[0] in _BYTES:
                yield _Part(path, "bulk")
            elif item[0] == "string":
                yield _Part(path, "names")
            else:
                yield _Part(path, "numbers" if item[0] in _NUMBERS else "text")


def _named(fields: Kinds, name: str, path: str) -> _Part:
    """A sequence of messages: values with their names, as in control_msgs/InterfaceValue, or anything else."""
    parts = list(_parts(fields, name))
    names = [part.path for part in parts if part.kind == "names"]
    numbers = [part.path for part in parts if part.kind == "numbers"]
    if len(parts) == 2 and names and numbers:
        return _Part(path, "named", (names[0], numbers[0]))
    return _Part(path, "bulk")


class _Columns:
    """Columns that grow with the messages, and other ways to write their names."""

    def __init__(self, rows: int) -> None:
        self.values: defaultdict[str, Array] = defaultdict(lambda: np.full(rows, np.nan))
        self.paths: dict[str, str] = {}

    def set(self, row: int, name: str, value: float, path: str = "") -> None:
        """Put a value into a column; `path` is another name of it, unless it was that of another column before."""
        self.values[name][row] = value
        if path and self.paths.setdefault(path, name) != name:
            self.paths[path] = ""


def decode_any(
    typestore: Typestore, type_name: str, payloads: Sequence[bytes]
) -> tuple[Integers | None, tuple[str, ...], Array, dict[str, str]]:
    """Decode messages of any known type.

    Numbers of an array are named after the texts of a top-level array of equal length in the same message, such as
    ``joint_names``; joints may change place between messages.

    Returns `stamp_ns` (n,): header stamps; None when the type has no header.
    and `names`: paths of the numbers, such as ``wrench.force.x`` and ``data[0]``, in the order of first appearance;
    with names of joints ``motor.feedback.positions`` and ``motor.position``; bare numbers and arrays (std_msgs) are
    named ``"0"``, ``"1"``, ...
    and `values` (n, columns): NaN where a message has no such number.
    and `paths`: names of columns by their place, such as ``feedback.positions[1]``, where it is the same in all
    messages.
    """
    from rosbags.interfaces import Nodetype

    fields = typestore.fielddefs
    stamped = any(one == ("header", (Nodetype.NAME, "std_msgs/msg/Header")) for one in fields[type_name][1])
    parts = [(part, attrgetter(part.path)) for part in _parts(fields, type_name)]
    namers = [get for part, get in parts if part.kind == "names" and "." not in part.path]
    stamps = np.zeros(len(payloads), dtype=np.int64)
    columns = _Columns(len(payloads))
    for row, payload in enumerate(payloads):
        message: Any = typestore.deserialize_cdr(payload, type_name)
        if stamped:
            stamps[row] = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        names = {len(found): found for get in reversed(namers) if (found := get(message))}
        for part, get in parts:
            _read_part(columns, row, part, get(message), names)
    found_names = tuple(columns.values)
    if type_name.startswith("std_msgs/msg/"):
        found_names = tuple(str(index) for index in range(len(found_names)))
    table = np.column_stack(list(columns.values.values())) if columns.values else np.empty((len(payloads), 0))
    paths = {path: name for path, name in columns.paths.items() if name and path not in columns.values}
    return (stamps if stamped else None), found_names, table, paths


def _read_part(columns: _Columns, row: int, part: _Part, value: Any, names: Mapping[int, Sequence[str]]) -> None:
    """Put the numbers of one part of a message into their columns."""
    if part.kind == "number":
        columns.set(row, part.path, value)
    if part.kind not in ("numbers", "named") or len(value) > _LONGEST:
        return
    owners = names.get(len(value))
    for index, item in enumerate(value):
        place = f"{part.path}[{index}]"
        if part.kind == "named":  # such as those of one joint
            own_names, numbers = (attrgetter(path)(item) for path in part.inner)
            owner = place if owners is None else owners[index]
            for inner, (name, number) in enumerate(zip(own_names, numbers, strict=False)):
                columns.set(row, f"{owner}.{name}", number, f"{place}.{part.inner[1]}[{inner}]")
        elif owners is None:
            columns.set(row, place, item)
        else:
            columns.set(row, f"{owners[index]}.{part.path}", item, place)
