"""Dataclasses as key values of a diagnostic status and back, without loss.

A field becomes a key of its name; a dict of numbers becomes a key for each entry, ``name/entry``. Fields of other types
are left to the caller. Metadata of a field: ``key``, another key than its name; ``added``, messages of earlier versions
do not have it, so the default is taken.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar, get_type_hints

from idloop.errors import InputError
from idloop.json_values import to_json
from idloop.records.bags.cdr import CdrError
from idloop_nodes.codec.diagnostics import Status

# As in every printout and on every page: what stands after ± is the half-width of the 95 % interval.
_NORMAL_95 = 1.959963984540054

Summary = TypeVar("Summary")


def text_or_empty(value: float | None) -> str:
    """Return the number in full precision, empty for None and for one that is not known."""
    return "" if value is None or math.isnan(value) else repr(float(value))


def number_or_none(text: str) -> float | None:
    """Return the number that `text_or_empty` wrote."""
    return float(text) if text else None


def plus_minus(stderr: float | None, digits: int = 2) -> str:
    """Return the half-width of the 95 % interval as " ± 0.0022"; empty where it is not known."""
    return "" if stderr is None or not math.isfinite(stderr) else f" ± {_NORMAL_95 * stderr:.{digits}g}"


def as_json(document: Any) -> str:
    """Return a document as JSON; what is no finite number becomes null."""
    return json.dumps(to_json(document), ensure_ascii=False, allow_nan=False)


def _number(value: float) -> str:
    return repr(float(value))


def _span(text: str) -> tuple[int, int]:
    start, stop = text.split()
    return int(start), int(stop)


# Type of a field: how it is written, and how it is read.
_CONVERSIONS: dict[Any, tuple[Callable[[Any], str], Callable[[str], Any]]] = {
    str: (str, str),
    int: (str, int),
    float: (_number, float),
    bool: (lambda value: "true" if value else "false", lambda text: text == "true"),
    float | None: (text_or_empty, number_or_none),
    tuple[str, ...]: (" ".join, lambda text: tuple(text.split())),
    tuple[int, int]: (lambda span: " ".join(map(str, span)), _span),
}


def to_values(summary: Any) -> dict[str, str]:
    """Return the key values of a dataclass."""
    hints: dict[str, Any] = get_type_hints(type(summary))
    values: dict[str, str] = {}
    for one in fields(summary):
        value, kind = getattr(summary, one.name), hints[one.name]
        key = one.metadata.get("key") or one.name
        if kind == dict[str, float]:
            values |= {f"{key}/{name}": _number(number) for name, number in value.items()}
        elif kind in _CONVERSIONS:
            values[key] = _CONVERSIONS[kind][0](value)
    return values


def from_values(kind: Callable[..., Summary], values: Mapping[str, str], **more: Any) -> Summary:
    """Return the dataclass that `to_values` wrote; `more`: fields of other types. KeyError or ValueError otherwise."""
    hints, found = get_type_hints(kind), dict(more)
    for one in fields(kind):  # type: ignore[arg-type]
        key = one.metadata.get("key") or one.name
        if hints[one.name] == dict[str, float]:
            found[one.name] = {
                name.removeprefix(f"{key}/"): float(text) for name, text in values.items() if name.startswith(f"{key}/")
            }
        elif hints[one.name] in _CONVERSIONS and not (one.metadata.get("added") and key not in values):
            found[one.name] = _CONVERSIONS[hints[one.name]][1](values[key])
    return kind(**found)


@contextlib.contextmanager
def reading(topic: str, statuses: Sequence[Status]) -> Iterator[dict[str, str]]:
    """Give the key values of the first status; errors become a CdrError that names the topic."""
    if not statuses:
        raise CdrError(f"{topic} holds no status")
    try:
        yield statuses[0].values
    except (KeyError, ValueError, TypeError, AttributeError, InputError) as error:
        raise CdrError(f"{topic} cannot be read: {error}") from error
