"""How an effect's equation becomes a function that the compiled simulator can call.

Every equation of every effect has one signature, so the simulator is compiled once and
calls the active ones through their addresses: an effect is switched on by data, never by
recompiling, and an effect that is off costs nothing.
"""

from __future__ import annotations

import dis
from collections.abc import Callable
from functools import cached_property
from typing import Any


class Hook:
    """An equation, compiled when its address is first asked for and cached beside its file."""

    def __init__(self, function: Callable[..., float]) -> None:
        self.function = function
        self._compiled: Any = None

    @property
    def address(self) -> int:
        """Where the machine code starts, for the simulator."""
        if self._compiled is None:
            # imported here, so that reading a model file does not start the compiler
            from numba import cfunc, types

            number = types.float64
            array = types.CPointer(number)
            signature = number(number, number, number, number, array, array)
            # As in the simulator: what divides by nothing is not finite, and the search sees that.
            self._compiled = cfunc(signature, cache=True, error_model="numpy")(self.function)
        return int(self._compiled.address)

    @cached_property
    def arguments(self) -> tuple[bool, ...]:
        """Of each argument, by its place, whether the equation depends on it."""
        code, used = self.function.__code__, set[str]()
        for step in dis.get_instructions(code):
            used.update(step.argval if isinstance(step.argval, tuple) else (step.argval,))
        return tuple(name in used for name in code.co_varnames[: code.co_argcount])

    def __call__(self, *arguments: Any) -> float:
        """Evaluate the equation in plain Python, for plots and tests."""
        return float(self.function(*arguments))


def hook(function: Callable[..., float]) -> Hook:
    """Turn ``f(a, b, c, elapsed, state, parameters) -> float`` into an equation of an effect.

    What ``a, b, c`` are depends on the place of the equation, see `idloop.physics.effect`.
    ``elapsed`` is the time since ``state`` was settled [s]; ``state`` and ``parameters`` are
    indexed like arrays.
    """
    return Hook(function)
