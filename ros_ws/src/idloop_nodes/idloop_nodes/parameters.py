"""Parameters of a node from one declarative table: declaration, validation, application, documentation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from idloop.errors import InputError
from idloop.parameter_table import ParameterSpec

Values = dict[str, Any]
BIGGEST = 1.7976931348623157e308


@dataclass(frozen=True)
class NodeParameter(ParameterSpec):
    """One row of a node's parameter table: the library's row, and whether it is fixed at the start."""

    read_only: bool = False

    @classmethod
    def adopt(cls, spec: ParameterSpec, name: str, default: Any, *, read_only: bool = False) -> NodeParameter:
        """Return a row of the library under the name and default it has on a node."""
        own = {field.name: getattr(spec, field.name) for field in fields(ParameterSpec)}
        return cls(**(own | {"name": name, "default": default}), read_only=read_only)


Table = Sequence[NodeParameter]


def accept(spec: NodeParameter, value: object) -> Any:
    """Return the value in its plain type.

    ROS reads an empty list in a YAML file as "not set", so ``[""]`` stands for an empty list of texts.

    Raises InputError: wrong type, not finite, or outside the range.
    """
    if spec.type == "strs":
        value = [] if value is None else value
        checked = spec.check(value, "parameter")
        return [item for item in checked if item]
    if spec.type in ("floats", "matrix") and value is not None:
        value = list(value) if not isinstance(value, (str, int, float)) else value  # type: ignore[call-overload]
    return spec.check(value, "parameter")


def accept_all(table: Table, given: Mapping[str, object]) -> Values:
    """Return every value of a table, defaults filled in; InputError as `accept`."""
    return {spec.name: accept(spec, given.get(spec.name, spec.default)) for spec in table}


class NodeParameters:
    """The parameters of one running node.

    `node`: node to declare them on; `table`: what to declare. Attributes: `values`: current values, of the table's
    types. `check`: ``check(values)`` may refuse a combination by raising InputError; then nothing is applied. `apply`:
    ``apply(changed_names)`` is called after a change has been taken over.
    """

    def __init__(self, node: Any, table: Table) -> None:
        self.table = {spec.name: spec for spec in table}
        self.check: Callable[[Values], None] = lambda values: None
        self.apply: Callable[[set[str]], None] = lambda names: None
        self.values: Values = {spec.name: accept(spec, _declare(node, spec)) for spec in table}
        node.add_on_set_parameters_callback(self._on_set)
        node.add_post_set_parameters_callback(self._post_set)

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def _accept(self, parameters: Sequence[Any]) -> Values:
        own = [one for one in parameters if one.name in self.table]
        return {one.name: accept(self.table[one.name], one.value) for one in own}

    def _on_set(self, parameters: Sequence[Any]) -> Any:
        from rcl_interfaces.msg import SetParametersResult

        try:
            new = self._accept(parameters)
            if new:
                self.check(self.values | new)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _post_set(self, parameters: Sequence[Any]) -> None:
        new = self._accept(parameters)
        changed = {name for name, value in new.items() if value != self.values[name]}
        self.values.update(new)
        if changed:
            self.apply(changed)


def _declare(node: Any, spec: NodeParameter) -> object:
    """Declare one parameter; return what it starts with."""
    from rclpy.exceptions import InvalidParameterException, InvalidParameterValueException, ParameterException

    default = spec.default
    if spec.type == "strs":
        default = list(default) or [""]
    try:
        return node.declare_parameter(spec.name, default, descriptor(spec)).value
    except (InvalidParameterValueException, InvalidParameterException, ParameterException) as error:
        raise InputError(" ".join(str(error).split())) from error


def descriptor(spec: NodeParameter) -> Any:
    """Return the rcl_interfaces descriptor of one parameter."""
    from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

    text = spec.description + (f" [{spec.unit}]" if spec.unit else "")
    result = ParameterDescriptor(name=spec.name, description=text, read_only=spec.read_only)
    result.additional_constraints = spec.range_text
    # Lets an integer stand for a double and "not set" for an optional value; `accept` guards the type.
    result.dynamic_typing = True
    low, high = spec.minimum, spec.maximum
    if low is None and high is None:
        return result
    if spec.type == "float":
        bounds = (-BIGGEST if low is None else float(low), BIGGEST if high is None else float(high))
        result.floating_point_range = [FloatingPointRange(from_value=bounds[0], to_value=bounds[1])]
    elif spec.type == "int":
        whole = (-(2**63) if low is None else int(low), 2**63 - 1 if high is None else int(high))
        result.integer_range = [IntegerRange(from_value=whole[0], to_value=whole[1], step=1)]
    return result
