"""A controller as an object with one call per sample, for nodes and scripts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.control import step
from idloop.control.compensation import Plan
from idloop.control.compensation_settings import Settings
from idloop.control.packing import Kernel
from idloop.errors import InputError

_FAULTS = {
    step.BAD_MEASUREMENT: "measurement missing or not finite",
    step.BAD_REFERENCE: "reference not finite",
    step.BAD_FEEDFORWARD: "feedforward not finite",
    step.BAD_COMMAND: "computed command not finite",
}

Measurement = Mapping[str, float] | Sequence[float] | Array


class Controller:
    """A sampled controller; build one with ``build_controller``.

    `values`: from ``check_controller``. `kernel`: the same controller as flat arrays. `plan`, `settings`: of its
    compensator, if it has one.
    """

    def __init__(
        self, values: Mapping[str, Any], kernel: Kernel, plan: Plan | None = None, settings: Settings | None = None
    ) -> None:
        self.kind: str = values["type"]
        self.parameters = {name: value for name, value in values.items() if name != "type"}
        self.inputs = kernel.inputs
        self.sample_time: float = values["sample_time"]
        self.limit: float = math.inf if values["limit"] is None else values["limit"]
        self.kernel = kernel
        self.plan = plan
        self.settings = settings
        self._state = kernel.state.copy()
        self._y = np.zeros(len(kernel.inputs))
        # The compiled step is loaded now and not at the first sample of a running drive.
        self.step(0.0, 0.0, self._y)
        self.reset()

    @property
    def saturated(self) -> bool:
        """Whether the last command was limited."""
        return bool(self._state[step.SATURATED])

    @property
    def added(self) -> float:
        """Command that the compensator added to the last one, before the limit."""
        return float(self._state[step.ADDED])

    @property
    def fault(self) -> str | None:
        """Reason why the command is zero until `reset`, or None."""
        return _FAULTS.get(float(self._state[step.FAULT]))

    def reset(self, command: float | None = None) -> None:
        """Reset state and fault.

        `command`: bumpless transfer from this command: an integral is set so that the next step returns it. Controllers
        without an integral start from rest. Raises InputError: the command is not finite.
        """
        if command is not None and not math.isfinite(command):
            raise InputError(f"controller {self.kind}: reset command is {command}; give a finite one")
        self._state[:] = self.kernel.state
        if command is not None:
            self._state[step.TRACKING] = 1.0
            self._state[step.TRACKED_COMMAND] = command

    def step(
        self,
        reference_position: float,
        reference_velocity: float,
        measurement: Measurement,
        feedforward: float = 0.0,
    ) -> float:
        """One sample.

        `reference_position`, `reference_velocity`: reference. `measurement`: by name (others are ignored, a missing one
        is a fault), or in the order of `inputs`. `feedforward`: excitation, added before linearisation and limit.
        Returns the command; 0 from the first value that is not finite until `reset`, see `fault`. Raises InputError: a
        sequence of the wrong length.
        """
        if isinstance(measurement, Mapping):
            for i, name in enumerate(self.inputs):
                self._y[i] = measurement.get(name, math.nan)
        elif len(measurement) != len(self.inputs):
            reads = f"{len(self.inputs)} ({', '.join(self.inputs)})"
            raise InputError(f"controller {self.kind}: {len(measurement)} measurements given but it reads {reads}")
        else:
            self._y[:] = measurement
        law, reference = self.kernel, (float(reference_position), float(reference_velocity))
        return float(
            step.controller_step(law.kind, law.parameters, self._state, *reference, self._y, float(feedforward))
        )
