"""Tracking of a reference by a machine under a controller."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.control.compensation import followed_output
from idloop.control.controller import Controller
from idloop.physics.machine import Machine
from idloop.physics.model import Model


@dataclass(frozen=True, eq=False)
class Tracking:
    """One run of a closed loop, a row for each sample."""

    time: Array  # time since the first sample [s]
    output: Array  # measurements
    wanted: Array  # outputs with every body at the reference; NaN for outputs of another kind
    command: Array  # command after each measurement
    # Of the outputs
    names: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def error(self) -> Array:
        """Wanted minus measured (n, p)."""
        return self.wanted - self.output

    @property
    def followed(self) -> tuple[str, ...]:
        """Outputs that have a reference."""
        return tuple(name for name, column in zip(self.names, self.wanted.T, strict=True) if np.isfinite(column[0]))

    def error_of(self, name: str, settle: float = 0.0) -> TrackingError:
        """Sizes of the error of an output. `settle`: time at the beginning to leave out [s]."""
        late = self.time >= self.time[0] + settle
        error = self.error[late, self.names.index(name)]
        return TrackingError(float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error))), float(np.mean(error)))


@dataclass(frozen=True)
class TrackingError:
    """Root of the mean square, largest size, and mean of a tracking error, in the unit of the output."""

    rms: float
    largest: float
    mean: float


def wanted_outputs(model: Model, values: Mapping[str, Any], reference: Array) -> Array:
    """Outputs of a machine whose bodies all follow the reference.

    `values`: controller, from ``check_controller``; `reference`: position and velocity, in the controller's unit.
    Returns: NaN for outputs of another kind than the controlled one.
    """
    wanted = np.full((len(reference), len(model.outputs)), np.nan)
    followed = followed_output(model, values)
    if followed is None:
        return wanted
    column = reference[:, 1 if followed.field == "velocity" else 0] / (values["feedback_gain"] * followed.scale)
    for j, output in enumerate(model.outputs):
        if output.field == followed.field:
            wanted[:, j] = output.scale * column
    return wanted


def track(
    machine: Machine, controller: Controller, reference: Array, progress: Callable[[float], object] | None = None
) -> Tracking:
    """Run a machine under a controller, as the nodes do in lock-step.

    `machine`: at its start. `controller`: evaluated at each measurement, reset before the first. `reference` (n, 2):
    position and velocity, one row for each period of the controller. `progress`: called with the share of the work that
    is done.
    """
    model, period = machine.model, controller.sample_time
    columns = [model.output_names.index(name) for name in controller.inputs]
    output = np.empty((len(reference), len(model.outputs)))
    command = np.empty(len(reference))
    controller.reset()
    for k, (position, velocity) in enumerate(reference.tolist()):
        output[k] = machine.measure()
        command[k] = controller.step(position, velocity, output[k, columns])
        machine.step(float(command[k]), (k + 1) * period)
        if progress is not None and k % 1000 == 0:
            progress(k / len(reference))
    values = {"type": controller.kind, **controller.parameters}
    time, wanted = np.arange(len(reference), dtype=np.float64) * period, wanted_outputs(model, values, reference)
    return Tracking(time, output, wanted, command, model.output_names, tuple(one.unit for one in model.outputs))
