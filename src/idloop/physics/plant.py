"""A machine simulated step by step, for the plant node and for closed loops."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.physics import kernel
from idloop.physics.conditions import Condition, Conditions
from idloop.physics.layout import lay_out
from idloop.physics.model import Model

# Commands kept for delays; the older half is dropped when the memory is full.
COMMANDS_KEPT = 4096


def compiled(function: Any, *arguments: Any) -> Callable[..., Any]:
    """Return a compiled function for these argument types: numba's dispatch takes longer than a step of the machine."""
    if not hasattr(function, "compile"):
        return function  # type: ignore[no-any-return]  # numba is disabled
    from numba import typeof

    return function.compile(tuple(typeof(one) for one in arguments))  # type: ignore[no-any-return]


class Plant:
    """Simulate a model as a machine: commands in, noisy measurements out.

    `model`: the machine with its hidden effects. `seed`: seed of noise and disturbance. `noise`: add the measurement
    noise of the model's outputs. `disturbance_std`: standard deviation of a disturbance force on body 0
    (Ornstein-Uhlenbeck process). `disturbance_time_constant`: its correlation time [s]. `start_time`: time at the start
    [s]. `conditions`: temperature, supply, ... by time; without them they are at their references.
    """

    def __init__(
        self,
        model: Model,
        seed: int = 0,
        *,
        noise: bool = True,
        disturbance_std: float = 0.0,
        disturbance_time_constant: float = 1.0,
        start_time: float = 0.0,
        conditions: Iterable[Condition] | None = None,
    ) -> None:
        if disturbance_std < 0.0 or disturbance_time_constant <= 0.0:
            raise InputError("disturbance: the standard deviation must be >= 0 and the time constant > 0 s")
        self.model = model
        self._layout = lay_out(model).under(None if conditions is None else Conditions(conditions))
        self._random = np.random.default_rng(seed)
        self._noise_std = np.array([(output.noise or 0.0) if noise else 0.0 for output in model.outputs])
        self._disturbance_std = disturbance_std
        self._disturbance_time_constant = disturbance_time_constant
        self._work = np.zeros((9, self._layout.bodies))
        self._reading = np.zeros(len(model.outputs))
        self._command_time = np.zeros(COMMANDS_KEPT)
        self._command = np.zeros(COMMANDS_KEPT)
        self._commands = 0
        self.start_time = start_time
        self.reset()
        axis, state, history, row = self._layout.axis, self._state, self._history, self._command_time
        self._read = compiled(kernel.read, axis, state, history, self._noise_std, self._reading)
        self._run = compiled(kernel.run, axis, row, row, 0.0, state, history, self._work)

    def reset(self) -> None:
        """Return to rest at position 0 and the start time; the random generator is not reset."""
        self._state = self._layout.new_state()
        self._state[kernel.TIME] = self.start_time
        self._history = self._layout.new_history()
        self._commands = 0
        if self._disturbance_std > 0.0:
            self._state[kernel.DISTURBANCE] = self._disturbance_std * self._random.standard_normal()

    @property
    def time(self) -> float:
        """Time now [s]."""
        return float(self._state[kernel.TIME])

    @property
    def position(self) -> NDArray[np.float64]:
        """True positions of the model's bodies (n,)."""
        return np.asarray(self._state[kernel.FIRST + np.array(self._layout.body_of)])

    @property
    def velocity(self) -> NDArray[np.float64]:
        """True velocities of the model's bodies (n,)."""
        return np.asarray(self._state[kernel.FIRST + self._layout.bodies + np.array(self._layout.body_of)])

    def measure(self) -> NDArray[np.float64]:
        """Read the sensors now, with noise (p,)."""
        noise = self._noise_std * self._random.standard_normal(len(self._noise_std))
        self._read(self._layout.axis, self._state, self._history, noise, self._reading)
        return np.array(self._reading)

    def schedule(self, stamp: float, command: float) -> None:
        """Apply a command from ``stamp`` [s] on, or from now when that is past.

        Raises InputError: the command is not finite.
        """
        if not math.isfinite(command):
            raise InputError(f"command at {stamp:g} s is not finite")
        stamp = max(stamp, self.time)
        if self._commands and stamp < self._command_time[self._commands - 1]:
            stamp = float(self._command_time[self._commands - 1])
        if self._commands == len(self._command):
            self._forget()
        self._command_time[self._commands] = stamp
        self._command[self._commands] = command
        self._commands += 1

    def advance(self, until: float) -> None:
        """Run to a time [s]."""
        if self._disturbance_std > 0.0:
            keep = math.exp(-max(until - self.time, 0.0) / self._disturbance_time_constant)
            fresh = self._disturbance_std * math.sqrt(1.0 - keep * keep) * self._random.standard_normal()
            self._state[kernel.DISTURBANCE] = keep * self._state[kernel.DISTURBANCE] + fresh
        commands = self._command_time[: self._commands], self._command[: self._commands]
        self._run(self._layout.axis, *commands, until, self._state, self._history, self._work)

    def step(self, command: float, until: float) -> None:
        """Apply a command from now on and run to ``until`` [s]."""
        self.schedule(self.time, command)
        self.advance(until)

    def _forget(self) -> None:
        half = len(self._command) // 2
        if self._state[kernel.COMMAND] < half:
            # A long delay: most commands have not acted yet.
            self._command_time = np.concatenate((self._command_time, np.zeros(2 * half)))
            self._command = np.concatenate((self._command, np.zeros(2 * half)))
            return
        self._command_time[:half] = self._command_time[half:]
        self._command[:half] = self._command[half:]
        self._commands -= half
        self._state[kernel.COMMAND] -= half
