"""Declarative parameter tables for validation, help texts and ROS declarations."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

from idloop.documents import read_yaml
from idloop.errors import InputError
from idloop.spelling import did_you_mean

ParameterType = Literal["float", "int", "bool", "str", "floats", "strs", "matrix"]


class _Required:
    """Marks a parameter without a default."""

    def __repr__(self) -> str:
        return "required"


REQUIRED: Final = _Required()

_ROS_TYPES: Final[dict[str, str]] = {
    "float": "double",
    "int": "integer",
    "bool": "bool",
    "str": "string",
    "floats": "double_array",
    "strs": "string_array",
    "matrix": "double_array",
}

_WORDS: Final[dict[str, str]] = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "str": "a text",
    "floats": "a list of numbers",
    "strs": "a list of texts",
    "matrix": "a list of rows of numbers",
}


@dataclass(frozen=True)
class ParameterSpec:
    """One row of a parameter table."""

    name: str  # name of the parameter; a dot stands for a nested mapping (``linearisation.gain``)
    type: ParameterType  # ``float``, ``int``, ``bool``, ``str``, ``floats``, ``strs`` or ``matrix`` (equal rows)
    # Value when the parameter is left out; ``REQUIRED`` when it must be given. With a default of None, None is a legal
    # value and means "off" or "chosen automatically".
    default: Any
    description: str  # one sentence for help texts
    unit: str = ""  # unit of the value, empty when it has none
    # Range of a number, or of every number of a list
    minimum: float | None = None
    maximum: float | None = None
    exclusive: bool = False  # the ends of the range are themselves not allowed
    nonzero: bool = False  # zero is not allowed
    choices: tuple[str, ...] = ()  # the allowed texts, where only some are

    @property
    def required(self) -> bool:
        """Whether the parameter has no default."""
        return self.default is REQUIRED

    @property
    def ros_type(self) -> str:
        """Name of the matching ROS parameter type (a matrix is passed row by row)."""
        return _ROS_TYPES[self.type]

    @property
    def range_text(self) -> str:
        """Text of the allowed values; empty when every finite value is allowed."""
        if self.choices:
            return " | ".join(self.choices)
        more, less = (">", "<") if self.exclusive else (">=", "<=")
        parts = []
        if self.minimum is not None:
            parts.append(f"{more} {self.minimum:g}")
        if self.maximum is not None:
            parts.append(f"{less} {self.maximum:g}")
        if self.nonzero:
            parts.append("not 0")
        return ", ".join(parts)

    def check(self, value: Any, where: str) -> Any:
        """Return the value in its plain Python type.

        `value`: what the user gave.
        `where`: place named at the start of the error line, for example ``controller pid``.
        Raises InputError: wrong type, not finite, or outside the range.
        """
        if value is None and self.default is None:
            return None
        if self.type == "float":
            return self._number(value, where)
        if self.type == "int":
            return self._integer(value, where)
        if self.type == "bool":
            if not isinstance(value, bool):
                raise self._wrong_type(value, where)
            return value
        if self.type == "str":
            return self._text(value, where)
        if not isinstance(value, Iterable) or isinstance(value, (str, bytes, Mapping)):
            raise self._wrong_type(value, where)
        items = list(value)
        if self.type == "strs":
            return tuple(self._text(item, where) for item in items)
        if self.type == "floats":
            return tuple(self._number(item, where) for item in items)
        return self._matrix(items, where)

    def _number(self, value: Any, where: str) -> float:
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise self._wrong_type(value, where)
        number = float(value)
        if not math.isfinite(number):
            raise InputError(f"{where}: {self.name} is {number}; give a finite number{self._unit_hint()}")
        low = self.minimum is not None and (number <= self.minimum if self.exclusive else number < self.minimum)
        high = self.maximum is not None and (number >= self.maximum if self.exclusive else number > self.maximum)
        if low or high or (self.nonzero and number == 0.0):
            raise InputError(f"{where}: {self.name} is {number:g} but must be {self.range_text}")
        return number

    def _integer(self, value: Any, where: str) -> int:
        if isinstance(value, bool) or not isinstance(value, numbers.Integral):
            raise self._wrong_type(value, where)
        self._number(value, where)
        return int(value)

    def _text(self, value: Any, where: str) -> str:
        if not isinstance(value, str):
            raise self._wrong_type(value, where)
        if self.choices and value not in self.choices:
            hint = did_you_mean(value, self.choices)
            raise InputError(f"{where}: {self.name} is {value!r}{hint}; choose one of {', '.join(self.choices)}")
        return str(value)

    def _matrix(self, rows: list[Any], where: str) -> tuple[tuple[float, ...], ...]:
        if not all(isinstance(row, Iterable) and not isinstance(row, (str, Mapping)) for row in rows):
            raise self._wrong_type(rows, where)
        matrix = tuple(tuple(self._number(item, where) for item in row) for row in rows)
        if len({len(row) for row in matrix}) > 1:
            raise InputError(f"{where}: the rows of {self.name} differ in length; give every row the same length")
        return matrix

    def _unit_hint(self) -> str:
        return f" in {self.unit}" if self.unit else ""

    def _wrong_type(self, value: Any, where: str) -> InputError:
        shown = "nothing" if value is None else f"{type(value).__name__} {_short(value)}"
        return InputError(f"{where}: {self.name} must be {_WORDS[self.type]}{self._unit_hint()}, got {shown}")


def positive(name: str, default: Any, description: str, unit: str = "") -> ParameterSpec:
    """Row of a number above zero."""
    return ParameterSpec(name, "float", default, description, unit, minimum=0.0, exclusive=True)


def check_values(specs: Sequence[ParameterSpec], given: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Validate a mapping against a table and fill in the defaults.

    `specs`: the table; its order is the order of the result.
    `given`: values by name; nested mappings are read as dotted names.
    `where`: place named at the start of every error line.
    Returns: every parameter of the table by (dotted) name.
    Raises InputError: unknown name (with the nearest known one), missing name, or a value that does not fit.
    """
    by_name = {spec.name: spec for spec in specs}
    flat = flatten(given, by_name)
    for name in flat:
        if name not in by_name:
            known = ", ".join(by_name) or "none"
            raise InputError(f"{where}: unknown parameter {name!r}{did_you_mean(name, by_name)}; known: {known}")
    values: dict[str, Any] = {}
    for spec in specs:
        if spec.name in flat:
            values[spec.name] = spec.check(flat[spec.name], where)
        elif spec.required:
            raise InputError(f"{where}: {spec.name} is missing; {spec.description.rstrip('.')}")
        else:
            values[spec.name] = spec.default
    return values


def flatten(given: Mapping[str, Any], known: Iterable[str], prefix: str = "") -> dict[str, Any]:
    """Turn nested mappings into dotted names; a group that is None is left out."""
    groups = {name[:i] for name in known for i, letter in enumerate(name) if letter == "."}
    flat: dict[str, Any] = {}
    for key, value in given.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            flat.update(flatten(value, known, f"{name}."))
        elif value is not None or name not in groups:
            flat[name] = value
    return flat


def _short(value: Any) -> str:
    text = repr(value).replace("\n", " ")
    return text if len(text) <= 40 else f"{text[:37]}..."


def read_mapping(text: str, where: str, example: str) -> dict[str, Any]:
    """Read parameters in one line of YAML, as on the command line and in node parameters.

    `where`: place named at the start of an error line.
    `example`: correct form, for the error line.
    Raises InputError: not YAML, or not a mapping.
    """
    read = read_yaml(text, where)
    if not isinstance(read, dict):
        raise InputError(f"{where}: {_short(text)} is no mapping such as {example}")
    return read
