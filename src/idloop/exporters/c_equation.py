"""The equation of an effect as a C99 function: translated, so that firmware computes what the simulator does."""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Mapping
from typing import Any

from idloop.errors import InputError
from idloop.physics.hooks import Hook

_OPERATORS: Mapping[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_COMPARISONS: Mapping[type, str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip
_FUNCTIONS = {"abs": "fabs", "min": "fmin", "max": "fmax"}
_MATH = ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh", "atan", "atan2", "floor", "ceil", "fabs", "copysign", "pow")
_POINTERS = ("state", "parameters")


def c_function(name: str, hook: Hook) -> str:
    """Translate an equation without memory.

    `name`: of the C function, ``double name(a, b, c, elapsed, state, parameters)``.
    Returns: its definition.
    Raises InputError: the equation contains what has no translation, such as a loop.
    """
    tree = ast.parse(textwrap.dedent(inspect.getsource(hook.function))).body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise InputError("no translation to C: the equation is no function")
    return _Writer(hook.function.__globals__).function(name, tree)


def _reads(values: ast.expr, target: ast.expr) -> bool:
    own = {one.id for one in ast.walk(target) if isinstance(one, ast.Name)}
    return any(isinstance(one, ast.Name) and one.id in own for one in ast.walk(values))


class _Writer:
    def __init__(self, constants: Mapping[str, Any]) -> None:
        self._constants, self._names = constants, set[str]()

    def function(self, name: str, tree: ast.FunctionDef) -> str:
        arguments = [one.arg for one in tree.args.args]
        stored = [one.id for one in ast.walk(tree) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)]
        local = [one for one in dict.fromkeys(stored) if one not in arguments]
        self._names = {*arguments, *local}
        typed = ", ".join(f"const double *{one}" if one in _POINTERS else f"double {one}" for one in arguments)
        head = [f"    double {one} = 0.0;" for one in local] + ["    " + " ".join(f"(void){one};" for one in arguments)]
        lines = [f"static inline double {name}({typed})", "{", *head, *self._block(tree.body, 1), "}"]
        return "\n".join(lines) + "\n"

    def _block(self, body: list[ast.stmt], depth: int) -> list[str]:
        lines = []
        for statement in body:
            lines += self._statement(statement, "    " * depth, depth)
        return lines

    def _statement(self, node: ast.stmt, indent: str, depth: int) -> list[str]:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):  # the docstring
            return []
        if isinstance(node, ast.Return) and node.value is not None:
            return [f"{indent}return {self._of(node.value)};"]
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            target = node.targets[0]
            if isinstance(target, ast.Name):
                return [f"{indent}{target.id} = {self._of(node.value)};"]
            # One after the other in C: what is assigned must not be read beside it.
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple) and not _reads(node.value, target):
                pairs = zip(target.elts, node.value.elts, strict=True)
                return [f"{indent}{self._of(one)} = {self._of(value)};" for one, value in pairs]
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            return [f"{indent}{self._of(node.target)} = {self._of(node.value)};"]
        if isinstance(node, ast.AugAssign) and type(node.op) in _OPERATORS:
            return [f"{indent}{self._of(node.target)} {_OPERATORS[type(node.op)]}= {self._of(node.value)};"]
        if isinstance(node, ast.If):
            lines = [f"{indent}if ({self._of(node.test)}) {{", *self._block(node.body, depth + 1)]
            if node.orelse:
                lines += [f"{indent}}} else {{", *self._block(node.orelse, depth + 1)]
            return [*lines, f"{indent}}}"]
        raise InputError(f"no translation to C: {ast.unparse(node)}")

    def _of(self, node: ast.expr) -> str:
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return repr(float(node.value))
        if isinstance(node, ast.Attribute) and ast.unparse(node) == "math.pi":
            return repr(math.pi)
        if isinstance(node, ast.Name):
            return self._name(node.id)
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
            return f"{self._of(node.value)}[{node.slice.value!r}]"
        if isinstance(node, ast.BinOp):
            left, right = self._of(node.left), self._of(node.right)
            if isinstance(node.op, ast.Pow):
                return f"pow({left}, {right})"
            if type(node.op) in _OPERATORS:
                return f"({left} {_OPERATORS[type(node.op)]} {right})"
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            return f"({'-' if isinstance(node.op, ast.USub) else '!'}{self._of(node.operand)})"
        if isinstance(node, ast.BoolOp):
            word = " && " if isinstance(node.op, ast.And) else " || "
            return f"({word.join(self._of(one) for one in node.values)})"
        if isinstance(node, ast.Compare):
            sides = [self._of(one) for one in (node.left, *node.comparators)]
            signs = [_COMPARISONS[type(one)] for one in node.ops]
            parts = [f"{a} {sign} {b}" for a, sign, b in zip(sides, signs, sides[1:], strict=False)]
            return f"({' && '.join(parts)})"
        if isinstance(node, ast.IfExp):
            return f"({self._of(node.test)} ? {self._of(node.body)} : {self._of(node.orelse)})"
        if isinstance(node, ast.Call) and not node.keywords:
            return self._call(node)
        raise InputError(f"no translation to C: {ast.unparse(node)}")

    def _name(self, name: str) -> str:
        if name in self._names:
            return name
        value = self._constants.get(name)
        if isinstance(value, int | float):
            return repr(float(value))
        raise InputError(f"no translation to C: {name}")

    def _call(self, node: ast.Call) -> str:
        arguments = [self._of(one) for one in node.args]
        function = node.func
        if isinstance(function, ast.Name) and function.id in _FUNCTIONS:
            word = _FUNCTIONS[function.id]
            found = arguments[0] if word != "fabs" else f"fabs({arguments[0]})"
            for further in arguments[1:]:
                found = f"{word}({found}, {further})"
            return found
        if isinstance(function, ast.Attribute) and function.attr in _MATH:
            return f"{function.attr}({', '.join(arguments)})"
        raise InputError(f"no translation to C: {ast.unparse(node)}")
