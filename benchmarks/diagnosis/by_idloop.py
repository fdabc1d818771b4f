"""Machines simulated by idloop itself, stepped sample by sample."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class IdloopMachine:
    """A machine that is stepped sample by sample.

    Parameters
    ----------
    model : idloop.physics.Model
        The machine, hidden effects included.
    sample_time : float
        Seconds between samples.
    samples : int
        How many there will be.
    """

    def __init__(self, model: Any, sample_time: float, samples: int) -> None:
        from idloop.physics import kernel
        from idloop.physics.layout import lay_out

        self._kernel, self._layout = kernel, lay_out(model)
        self._state, self._history = self._layout.new_state(), self._layout.new_history()
        self._work = np.zeros((9, self._layout.bodies))
        self._time = np.asarray(np.arange(samples + 1) * sample_time)
        self._command = np.zeros(samples + 1)
        self._sample = 0
        self._outputs = len(model.outputs)

    def measure(self, noise: Array) -> Array:
        """Read the sensors now."""
        reading = np.empty(self._outputs)
        self._kernel.read(self._layout.axis, self._state, self._history, noise, reading)
        return reading

    def step(self, command: float, disturbance: float) -> None:
        """Hold a command and a disturbance for one sample."""
        k = self._sample
        self._command[k] = command
        self._state[self._kernel.DISTURBANCE] = disturbance
        self._kernel.run(
            self._layout.axis,
            self._time[: k + 1],
            self._command[: k + 1],
            self._time[k + 1],
            self._state,
            self._history,
            self._work,
        )
        self._sample += 1
