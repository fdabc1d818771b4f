"""Signals computed from columns: ``theta + alpha``, ``pos[1] - pos[0]``, ``load * volts``.

Sums, differences, products, quotients and powers of columns and numbers, and a few functions. Only what is listed here
is evaluated; a formula cannot call, import or look up anything else.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeAlias

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.tables.csv_layout import is_number
from idloop.spelling import check_known, listed

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
_LONGEST, _DEEPEST = 1000, 50
_PLACE = "column_{}_"
# Value of a part of a formula, by the columns.
_Value: TypeAlias = Callable[[Mapping[str, Array]], Any]


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
        self.columns: list[str] = []
        if len(text) > _LONGEST:
            raise InputError(f"formula of {len(text)} characters; at most {_LONGEST} are read")
        quoted = _QUOTED.findall(text)
        self._quoted: dict[str, str] = {_PLACE.format(place): name for place, name in enumerate(quoted)}
        places = iter(self._quoted)
        plain = _QUOTED.sub(lambda _: f" {next(places)} ", text)
        try:
            tree = ast.parse(plain.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise InputError(
                f"{text!r} is no formula; write columns, numbers and + - * / ( ), names that are no plain"
                " words in `backquotes`"
            ) from None
        self._value = self._part(tree, 0)

    def _part(self, node: ast.expr, depth: int) -> _Value:
        """A function for the value of a node; what is no part of a formula is refused."""
        if depth > _DEEPEST:
            raise InputError(f"{self.text!r} is nested too deeply")
        match node:
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                binary, one, other = _BINARY[type(op)], self._part(left, depth + 1), self._part(right, depth + 1)
                return lambda columns: binary(one(columns), other(columns))
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
                unary, only = _UNARY[type(op)], self._part(operand, depth + 1)
                return lambda columns: unary(only(columns))
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]):
                if name not in _FUNCTIONS:
                    raise InputError(f"{self.text!r}: no function {name!r}; known are {listed(_FUNCTIONS)}")
                inner = self._part(argument, depth + 1)
                return lambda columns: _FUNCTIONS[name](inner(columns))
            case ast.Name(id=name) if name in _CONSTANTS:
                return lambda _: _CONSTANTS[name]
            case ast.Name() | ast.Attribute() if name := self._dotted(node):
                if name not in self.columns:
                    self.columns.append(name)
                return lambda columns: columns[name]
            case ast.Constant(value=bool()):
                raise InputError(f"{self.text!r} is no formula of numbers")
            case ast.Constant(value=int() | float() as number):
                return lambda _: np.float64(number)
        raise InputError(f"{self.text!r} holds more than columns, numbers, + - * / % ** and {listed(_FUNCTIONS)}")

    def _dotted(self, node: ast.expr) -> str:
        """Name of a column, such as ``u`` or ``drive.u``; empty where it is none."""
        match node:
            case ast.Name(id=name):
                return self._quoted.get(name, name)
            case ast.Attribute(value=ast.Name() | ast.Attribute() as value, attr=name):
                return f"{self._dotted(value)}.{name}"
        return ""

    def evaluate(self, columns: Mapping[str, Array]) -> Array:
        """Return the values, shape (n,); what has no value, such as a quotient by zero, is NaN.

        Raises InputError: a column is missing.
        """
        for name in self.columns:
            check_known(name, columns, f"{self.text!r}: no column")
        with np.errstate(all="ignore"):
            value = np.asarray(self._value(columns), dtype=np.float64)
        return np.where(np.isfinite(value), value, np.nan)
