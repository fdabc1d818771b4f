"""Equations of effects as functions that the compiled simulator can call.

All equations have one signature, so that the simulator is compiled once and calls the active ones
by their addresses: an effect is activated by data, without compilation, and an inactive one costs nothing.
"""

from __future__ import annotations

import dis
from collections.abc import Callable
from functools import cached_property
from typing import Any


class Hook:
    """An equation, compiled at the first use of its address and cached beside its file."""

    def __init__(self, function: Callable[..., float]) -> None:
        self.function = function
        self._compiled: Any = None

    @property
    def address(self) -> int:
        """Address of the machine code, for the simulator."""
        if self._compiled is None:
            # Imported here, so that reading a model file does not load the compiler.
            from numba import cfunc, types

            number = types.float64
            array = types.CPointer(number)
            signature = number(number, number, number, number, array, array)
            # As in the simulator: a division by zero gives a value that is not finite.
            self._compiled = cfunc(signature, cache=True, error_model="numpy")(self.function)
        return int(self._compiled.address)

    @cached_property
    def arguments(self) -> tuple[bool, ...]:
        """Whether the equation depends on each argument."""
        code, used = self.function.__code__, set[str]()
        for step in dis.get_instructions(code):
            used.update(step.argval if isinstance(step.argval, tuple) else (step.argval,))
        return tuple(name in used for name in code.co_varnames[: code.co_argcount])

    def __call__(self, *arguments: Any) -> float:
        """Evaluate the equation in plain Python, for plots and tests."""
        return float(self.function(*arguments))


def hook(function: Callable[..., float]) -> Hook:
    """Turn ``f(a, b, c, elapsed, state, parameters) -> float`` into an equation of an effect.

    The meaning of ``a, b, c`` depends on the place of the equation, see `idloop.physics.effect`.
    ``elapsed`` is the time since ``state`` was settled [s]; ``state`` and ``parameters`` are
    indexed like arrays.
    """
    return Hook(function)
