"""Controllers around the machines: idloop's own, and one written here for the foreign simulators."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from simulators import Law

Array = NDArray[np.float64]


class Pid:
    """PID on one output, derivative on the measurement only, integral stopped while the command is limited."""

    def __init__(self, spec: Mapping[str, Any], column: int) -> None:
        self._column = column
        self._kp, self._ki, self._kd = (float(spec.get(key, 0.0)) for key in ("kp", "ki", "kd"))
        self._period, self._filter = float(spec["sample_time"]), float(spec.get("derivative_filter", 0.0))
        self._limit = float(spec.get("limit") or math.inf)
        self._gain = float(spec.get("feedback_gain", 1.0))
        self._integral = self._slope = 0.0
        self._previous: float | None = None

    def __call__(self, reference: float, rate: float, output: Array) -> float:
        """One sample."""
        measured = self._gain * float(output[self._column])
        if self._previous is not None:
            change = measured - self._previous
            self._slope = (self._filter * self._slope + change) / (self._filter + self._period)
        self._previous = measured
        error = reference - measured
        wanted = self._kp * error + self._integral - self._kd * self._slope
        command = min(max(wanted, -self._limit), self._limit)
        if command == wanted or error * wanted < 0.0:
            self._integral += self._ki * self._period * error
        return command


class Cascade:
    """Position P around velocity PI on one encoder; the integral is stopped while the command is limited."""

    def __init__(self, spec: Mapping[str, Any], column: int) -> None:
        self._column = column
        self._kp, self._kv, self._ki = float(spec["kp"]), float(spec["kv"]), float(spec.get("ki", 0.0))
        self._ahead = float(spec.get("velocity_feedforward", 0.0))
        self._period, self._filter = float(spec["sample_time"]), float(spec.get("velocity_filter", 0.0))
        self._limit = float(spec.get("limit") or math.inf)
        self._integral = self._speed = 0.0
        self._previous: float | None = None

    def __call__(self, reference: float, rate: float, output: Array) -> float:
        """One sample."""
        place = float(output[self._column])
        if self._previous is not None:
            self._speed = (self._filter * self._speed + place - self._previous) / (self._filter + self._period)
        self._previous = place
        error = self._kp * (reference - place) + self._ahead * rate - self._speed
        wanted = self._kv * error + self._integral
        command = min(max(wanted, -self._limit), self._limit)
        if command == wanted or error * wanted < 0.0:
            self._integral += self._ki * self._period * error
        return command


def law(simulator: str, spec: Mapping[str, Any] | None, output_names: tuple[str, ...]) -> Law | None:
    """The controller of a closed loop, or None.

    Parameters
    ----------
    simulator : str
        idloop's own controller runs around idloop's own machine only.
    spec : mapping or None
        ``controller`` of the model.
    output_names : tuple of str
        Columns of the measurement.
    """
    if spec is None:
        return None
    column = output_names.index(str(spec["output"]))
    if simulator != "idloop":
        return Cascade(spec, column) if spec["type"] == "cascade" else Pid(spec, column)
    from idloop.control import build_controller

    controller = build_controller(dict(spec))

    def step(reference: float, rate: float, output: Array) -> float:
        return controller.step(reference, rate, output[column : column + 1])

    return step
