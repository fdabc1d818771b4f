"""Numbers inside messages of any known type, as named columns."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rosbags.typesys.store import Typestore

_NUMBERS = {"float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "bool"}
_BYTES = {"uint8", "int8", "byte", "char", "octet", "bool"}
_SKIPPED = {"std_msgs/msg/Header", "builtin_interfaces/msg/Time", "std_msgs/msg/MultiArrayLayout"}
_LONGEST = 64  # longer arrays are images, scans or maps, not signals of an axis


def has_header(fields: Mapping[str, Any], name: str) -> bool:
    """Tell whether a message type starts with a std_msgs/Header."""
    from rosbags.interfaces import Nodetype

    return any(field == "header" and node == (Nodetype.NAME, "std_msgs/msg/Header") for field, node in fields[name][1])


def carries_signals(fields: Mapping[str, Any], name: str) -> bool:
    """Tell from its definition whether a type holds numbers of an axis rather than images, maps or text."""
    kinds = set(_kinds(fields, name))
    return bool(kinds & {"number", "numbers"}) and "bulk" not in kinds


def _kinds(fields: Mapping[str, Any], name: str) -> list[str]:
    from rosbags.interfaces import Nodetype

    kinds: list[str] = []
    for _, (kind, args) in fields[name][1]:
        if kind == Nodetype.BASE:
            kinds.append("number" if args[0] in _NUMBERS else "text")
        elif kind == Nodetype.NAME:
            kinds.extend([] if args in _SKIPPED else _kinds(fields, args))
        else:
            inner_kind, inner = args[0]
            if inner_kind != Nodetype.BASE or (kind == Nodetype.SEQUENCE and inner[0] in _BYTES):
                kinds.append("bulk")
            else:
                kinds.append("numbers" if inner[0] in _NUMBERS else "text")
    return kinds


def leaf_values(message: Any, fields: Mapping[str, Any], name: str, prefix: str = "") -> dict[str, float]:
    """Return the numbers of one message by path: ``wrench.force.x``, ``data[0]``."""
    from rosbags.interfaces import Nodetype

    found: dict[str, float] = {}
    for field, (kind, args) in fields[name][1]:
        value = getattr(message, field)
        path = prefix + field
        if kind == Nodetype.BASE:
            if args[0] in _NUMBERS:
                found[path] = float(value)
        elif kind == Nodetype.NAME:
            if args not in _SKIPPED:
                found.update(leaf_values(value, fields, args, path + "."))
        elif args[0][0] == Nodetype.BASE and args[0][1][0] in _NUMBERS and len(value) <= _LONGEST:
            found.update({f"{path}[{index}]": float(item) for index, item in enumerate(value)})
    return found


def table_of(rows: list[dict[str, float]]) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Return column names in the order of first appearance and the values (n, columns), NaN where absent."""
    names: dict[str, int] = {}
    for row in rows:
        for name in row:
            names.setdefault(name, len(names))
    values = np.full((len(rows), len(names)), np.nan)
    for index, row in enumerate(rows):
        for name, value in row.items():
            values[index, names[name]] = value
    return tuple(names), values


def decode_any(
    typestore: Typestore, type_name: str, payloads: list[bytes]
) -> tuple[NDArray[np.int64] | None, tuple[str, ...], NDArray[np.float64]]:
    """Decode messages of any known type.

    Returns
    -------
    stamp_ns : ndarray of int64, shape (n,), or None
        Header stamps; None when the type has no header.
    names : tuple of str
        Paths of the numbers; bare numbers and arrays (std_msgs) are named ``"0"``, ``"1"``, ...
    values : ndarray, shape (n, columns)
    """
    fields = typestore.fielddefs
    stamped = has_header(fields, type_name)
    stamps = np.zeros(len(payloads), dtype=np.int64)
    rows = []
    for index, payload in enumerate(payloads):
        message: Any = typestore.deserialize_cdr(payload, type_name)
        if stamped:
            stamps[index] = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        rows.append(leaf_values(message, fields, type_name))
    names, values = table_of(rows)
    if type_name.startswith("std_msgs/msg/"):
        names = tuple(str(index) for index in range(len(names)))
    return (stamps if stamped else None), names, values
