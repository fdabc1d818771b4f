"""Signals computed from columns: ``theta + alpha``, ``pos[1] - pos[0]``, ``load * volts``.

Sums, differences, products, quotients and powers of columns and numbers, and a few functions. Only what is listed here
is evaluated; a formula cannot call, import or look up anything else.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.tables.csv_layout import is_number
from idloop.spelling import did_you_mean, listed

_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.Mod: operator.mod,
}
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}
_FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "abs": np.abs,
    "sign": np.sign,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "deg2rad": np.deg2rad,
    "rad2deg": np.rad2deg,
}
_CONSTANTS = {"pi": np.pi}
_QUOTED = re.compile(r"`([^`]*)`")
_LONGEST = 1000
_PLACE = "column_{}_"


def in_backquotes(text: str, names: Iterable[str], *, numbers: bool = False) -> str:
    """Return a formula with backquotes around those of the names that need them and have none.

    Names that are numbers may be meant as such; where no other column is named they are not.

    Examples
    --------
    >>> in_backquotes("2 * 0/1023 + `a b`", ["0/1023", "a b", "u"])
    '2 * `0/1023` + `a b`'
    """
    needed = [one for one in names if one and is_number(one) == numbers and not one.replace(".", "").isidentifier()]
    if not needed:
        return text
    # The longest counts; no letter or digit may go on with it, nor decimals with a number.
    any_name = "|".join(re.escape(one) for one in sorted(needed, key=len, reverse=True))
    before, behind = (r"(?<![\w.])", r"(?![\w.])") if numbers else (r"(?<!\w)", r"(?!\w)")
    pieces = re.split(r"(`[^`]*`)", text)
    pieces[::2] = [re.sub(rf"{before}(?:{any_name}){behind}", r"`\g<0>`", piece) for piece in pieces[::2]]
    return "".join(pieces)


class Expression:
    """A formula over columns.

    `text`: names of columns, numbers, ``+ - * / % **``, brackets, ``abs sign sqrt sin cos tan deg2rad rad2deg pi``. A
    name that is no plain word stands in backquotes: `` `speed [rpm]` / 30 ``.
    Raises InputError: not such a formula.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self._quoted: list[str] = []
        if len(text) > _LONGEST:
            raise InputError(f"formula of {len(text)} characters; at most {_LONGEST} are read")
        plain = _QUOTED.sub(self._hide, text)
        try:
            self._tree = ast.parse(plain.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise InputError(
                f"{text!r} is no formula; write columns, numbers and + - * / ( ), names that are no plain"
                " words in `backquotes`"
            ) from None
        self.columns: list[str] = []
        self._collect(self._tree, 0)

    def _hide(self, match: re.Match[str]) -> str:
        self._quoted.append(match[1])
        return f" {_PLACE.format(len(self._quoted) - 1)} "

    def _dotted(self, node: ast.expr) -> str:
        """Name of a column, such as ``u`` or ``drive.u``; empty where it is none."""
        match node:
            case ast.Name(id=name):
                places = {_PLACE.format(k): quoted for k, quoted in enumerate(self._quoted)}
                return places.get(name, name)
            case ast.Attribute(value=ast.Name() | ast.Attribute() as value, attr=name):
                return f"{self._dotted(value)}.{name}"
        return ""

    def _is_constant(self, node: ast.expr) -> bool:
        return isinstance(node, ast.Name) and node.id in _CONSTANTS

    def _collect(self, node: ast.expr, depth: int) -> None:
        """Refuse what is no part of a formula, and note the columns."""
        if depth > 50:
            raise InputError(f"{self.text!r} is nested too deeply")
        match node:
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                self._collect(left, depth + 1)
                self._collect(right, depth + 1)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
                self._collect(operand, depth + 1)
            case ast.Call(func=ast.Name(id=name), args=[only], keywords=[]):
                if name not in _FUNCTIONS:
                    raise InputError(f"{self.text!r}: no function {name!r}; known are {listed(_FUNCTIONS)}")
                self._collect(only, depth + 1)
            case ast.Name() | ast.Attribute() if name := self._dotted(node):
                if name not in self.columns and not self._is_constant(node):
                    self.columns.append(name)
            case ast.Constant(value=bool()):
                raise InputError(f"{self.text!r} is no formula of numbers")
            case ast.Constant(value=int() | float()):
                pass
            case _:
                raise InputError(
                    f"{self.text!r} holds more than columns, numbers, + - * / % ** and {listed(_FUNCTIONS)}"
                )

    def evaluate(self, columns: Mapping[str, Array]) -> Array:
        """Return the values, shape (n,).

        `columns` (n,).
        Raises InputError: a column is missing.
        """
        for name in self.columns:
            if name not in columns:
                raise InputError(
                    f"{self.text!r}: no column {name!r}; there are {listed(columns)}{did_you_mean(name, columns)}"
                )
        with np.errstate(all="ignore"):
            value = np.asarray(self._value(self._tree, columns), dtype=np.float64)
        # What has no value, such as a quotient by zero, was not measured.
        return np.where(np.isfinite(value), value, np.nan)

    def _value(self, node: ast.expr, columns: Mapping[str, Array]) -> Any:
        match node:
            case ast.BinOp(left=left, op=op, right=right):
                return _BINARY[type(op)](self._value(left, columns), self._value(right, columns))
            case ast.UnaryOp(op=op, operand=operand):
                return _UNARY[type(op)](self._value(operand, columns))
            case ast.Call(func=ast.Name(id=name), args=[only]):
                return _FUNCTIONS[name](self._value(only, columns))
            case ast.Name(id=name) if self._is_constant(node):
                return _CONSTANTS[name]
            case ast.Name() | ast.Attribute():
                return columns[self._dotted(node)]
            case ast.Constant(value=int() | float() as number):
                return np.float64(number)
        raise AssertionError(node)
