"""Numbers inside messages of any known type, as named columns."""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rosbags.typesys.store import Typestore

_NUMBERS = {"float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "bool"}
_BYTES = {"uint8", "int8", "byte", "char", "octet", "bool"}
_SKIPPED = {"std_msgs/msg/Header", "builtin_interfaces/msg/Time", "std_msgs/msg/MultiArrayLayout"}
_LONGEST = 64  # longer arrays are images, scans or maps, not signals of an axis


def carries_signals(fields: Mapping[str, Any], name: str) -> bool:
    """Whether a type, by its definition, holds numbers of an axis rather than images, maps or text."""
    kinds = {kind for _, kind in _leaves(fields, name)}
    return bool(kinds & {"number", "numbers"}) and "bulk" not in kinds


def _leaves(fields: Mapping[str, Any], name: str, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield path and kind of the parts of a type: number, numbers (an array), text, or bulk (of any length)."""
    from rosbags.interfaces import Nodetype

    for field, (node, args) in fields[name][1]:
        path = prefix + field
        if node == Nodetype.BASE:
            yield path, "number" if args[0] in _NUMBERS else "text"
        elif node == Nodetype.NAME:
            yield from () if args in _SKIPPED else _leaves(fields, args, path + ".")
        else:
            item_node, item = args[0]
            if item_node != Nodetype.BASE or (node == Nodetype.SEQUENCE and item[0] in _BYTES):
                yield path, "bulk"
            else:
                yield path, "numbers" if item[0] in _NUMBERS else "text"


def decode_any(
    typestore: Typestore, type_name: str, payloads: list[bytes]
) -> tuple[NDArray[np.int64] | None, tuple[str, ...], NDArray[np.float64]]:
    """Decode messages of any known type.

    Returns
    -------
    stamp_ns : ndarray of int64, shape (n,), or None
        Header stamps; None when the type has no header.
    names : tuple of str
        Paths of the numbers, such as ``wrench.force.x`` and ``data[0]``, in the order of first appearance; bare numbers
        and arrays (std_msgs) are named ``"0"``, ``"1"``, ...
    values : ndarray, shape (n, columns)
        NaN where a message has no such number.
    """
    from rosbags.interfaces import Nodetype

    fields = typestore.fielddefs
    stamped = any(one == ("header", (Nodetype.NAME, "std_msgs/msg/Header")) for one in fields[type_name][1])
    leaves = [(path, kind, attrgetter(path)) for path, kind in _leaves(fields, type_name)]
    stamps = np.zeros(len(payloads), dtype=np.int64)
    columns: dict[str, NDArray[np.float64]] = {}

    def column(name: str) -> NDArray[np.float64]:
        if name not in columns:
            columns[name] = np.full(len(payloads), np.nan)
        return columns[name]

    for row, payload in enumerate(payloads):
        message: Any = typestore.deserialize_cdr(payload, type_name)
        if stamped:
            stamps[row] = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        for path, kind, get in leaves:
            if kind == "number":
                column(path)[row] = get(message)
            elif kind == "numbers" and len(values := get(message)) <= _LONGEST:
                for index, value in enumerate(values):
                    column(f"{path}[{index}]")[row] = value
    names = tuple(columns)
    if type_name.startswith("std_msgs/msg/"):
        names = tuple(str(index) for index in range(len(names)))
    table = np.column_stack(list(columns.values())) if columns else np.empty((len(payloads), 0))
    return (stamps if stamped else None), names, table
