"""Pickles as data: numbers, texts and containers are built, nothing that they name is imported or called.

The opcodes are those of `pickletools`; a name is kept as a name, and what a pickle would call is left to the caller.
"""

from __future__ import annotations

import io
import pickletools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from idloop.errors import InputError
from idloop.records.formats.form import reason_of

# Steps of one pickle; a recording of 10,000 tensors has 200,000.
_MOST_STEPS = 2_000_000
_PLAIN = frozenset({
    "INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT", "STRING", "BINSTRING",
    "SHORT_BINSTRING", "BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "UNICODE", "SHORT_BINUNICODE", "BINUNICODE",
    "BINUNICODE8",
})  # fmt: skip
_EMPTY: dict[str, Callable[[], Any]] = {"EMPTY_TUPLE": tuple, "EMPTY_LIST": list, "EMPTY_DICT": dict}
_KEY = (str, bytes, int, float, type(None))
_CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False}


@dataclass(frozen=True)
class Name:
    """A function or class that a pickle names."""

    module: str
    name: str

    def __str__(self) -> str:
        """As it is written in Python."""
        return f"{self.module}.{self.name}"


@dataclass(frozen=True)
class Pickled:
    """What a pickle holds, and where it ends in the data."""

    value: Any
    end: int


def refuse(name: object, arguments: object = ()) -> Any:
    """Refuse whatever a pickle would call.

    Raises InputError: always.
    """
    raise InputError(f"it holds an object of {name}, which is not read: only numbers, texts and tensors are")


def read_pickle(
    data: bytes,
    *,
    call: Callable[[Name, tuple[Any, ...]], Any] = refuse,
    persistent: Callable[[Any], Any] = lambda key: refuse("another file"),
) -> Pickled:
    """Build what a pickle holds.

    `data`: begins with the pickle; more may follow.
    `call`: value of a call of a name with arguments; refused by default.
    `persistent`: value of what is kept beside the pickle, by its key; refused by default.
    Raises InputError: damaged, or an object that is no data.
    """
    try:
        return _run(data, call, persistent)
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001 - the opcodes of damaged data fail in any way
        raise InputError(f"it is damaged ({reason_of(error, 80)})") from None


class _Mark:
    """Where a group of values begins on the stack."""


def _run(data: bytes, call: Callable[[Name, tuple[Any, ...]], Any], persistent: Callable[[Any], Any]) -> Pickled:
    stack: list[Any] = []
    memo: dict[int, Any] = {}

    def group() -> list[Any]:
        place = next(k for k in range(len(stack) - 1, -1, -1) if isinstance(stack[k], _Mark))
        values = stack[place + 1 :]
        del stack[place:]
        return values

    opcodes: Iterator[tuple[pickletools.OpcodeInfo, Any, int | None]] = pickletools.genops(io.BytesIO(data))
    for number, (opcode, argument, place) in enumerate(opcodes):
        step = opcode.name
        if number > _MOST_STEPS:
            raise InputError(f"it has more than {_MOST_STEPS:,} values; keep fewer")
        if step in _PLAIN:
            stack.append(argument)
        elif step in _EMPTY:
            stack.append(_EMPTY[step]())
        elif step in _CONSTANTS:
            stack.append(_CONSTANTS[step])
        elif step in ("PUT", "BINPUT", "LONG_BINPUT"):
            memo[int(argument)] = stack[-1]
        elif step == "MEMOIZE":
            memo[len(memo)] = stack[-1]
        elif step in ("GET", "BINGET", "LONG_BINGET"):
            stack.append(memo[int(argument)])
        elif step == "MARK":
            stack.append(_Mark())
        elif step in ("TUPLE", "LIST"):
            values = group()
            stack.append(tuple(values) if step == "TUPLE" else values)
        elif step in ("TUPLE1", "TUPLE2", "TUPLE3"):
            stack[-int(step[-1]) :] = [tuple(stack[-int(step[-1]) :])]
        elif step == "DICT":
            values = group()
            stack.append(_with_entries({}, values))
        elif step in ("APPEND", "APPENDS"):
            values = group() if step == "APPENDS" else [stack.pop()]
            _as(list, stack[-1]).extend(values)
        elif step in ("SETITEM", "SETITEMS"):
            values = group() if step == "SETITEMS" else [stack.pop(), stack.pop()][::-1]
            _with_entries(_as(dict, stack[-1]), values)
        elif step == "POP":
            stack.pop()
        elif step == "POP_MARK":
            group()
        elif step == "GLOBAL":
            stack.append(Name(*str(argument).split(" ", 1)))
        elif step == "STACK_GLOBAL":
            name, module = stack.pop(), stack.pop()
            stack.append(Name(_as(str, module), _as(str, name)))
        elif step in ("REDUCE", "NEWOBJ"):
            arguments, function = stack.pop(), stack.pop()
            stack.append(call(_as(Name, function), _as(tuple, arguments)))
        elif step == "BINPERSID":
            stack.append(persistent(stack.pop()))
        elif step == "BUILD":
            # Attributes of a dictionary are no data of it.
            stack.pop()
            _as(dict, stack[-1])
        elif step == "STOP":
            return Pickled(stack.pop(), (place or 0) + 1)
        elif step not in ("PROTO", "FRAME"):
            refuse(step)
    raise InputError("it is cut off")


def _with_entries(found: dict[Any, Any], values: list[Any]) -> dict[Any, Any]:
    """Add keys and values; a key that is a container could take any time to compute its hash of."""
    for key, value in zip(values[::2], values[1::2], strict=True):
        found[_as(_KEY, key)] = value
    return found


def _as(kind: type | tuple[type, ...], value: Any) -> Any:
    if not isinstance(value, kind):
        raise InputError(f"it is damaged (a value of the type {type(value).__name__} in the wrong place)")
    return value
