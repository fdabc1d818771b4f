"""Simulate a model in one call."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array
from idloop.physics.conditions import Condition, Conditions
from idloop.physics.engine import Engine
from idloop.physics.model import Model


@dataclass(frozen=True)
class Simulation:
    """Result of `simulate`."""

    time: Array  # shape (n,): when the outputs were read [s]
    output: Array  # shape (n, p): outputs in the units of the model
    names: tuple[str, ...]  # names of the outputs


def simulate(
    model: Model,
    input_time: ArrayLike,
    command: ArrayLike,
    time: ArrayLike,
    position: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    conditions: Iterable[Condition] | None = None,
) -> Simulation:
    """Simulate a model in free run.

    `model`: the axis. `input_time`, `command` (m,): commands in the model's input unit, each held from its time [s] on;
    0 before the first. `time` (n,): when the outputs are read [s]; the motion starts at the first. `position`,
    `velocity` (bodies,): motion at the start; at rest in 0 by default. `noise` (n, p): measurement noise, added before
    quantisation. `conditions`: temperature, supply, ...; without them they are at their references.

    Examples
    --------
    >>> from idloop.physics import load_model, simulate
    >>> import numpy as np
    >>> run = simulate(load_model("dc_motor"), [0.0], [1.0], np.linspace(0, 5, 51))
    >>> run.output.shape
    (51, 2)
    """
    engine = Engine(model)
    times = np.asarray(time, dtype=float)
    start = engine.initial_state(
        None if position is None else np.atleast_1d(np.asarray(position, dtype=float)),
        None if velocity is None else np.atleast_1d(np.asarray(velocity, dtype=float)),
    )
    output = engine.simulate(
        None,
        np.atleast_1d(np.asarray(input_time, dtype=float)),
        np.atleast_1d(np.asarray(command, dtype=float)),
        times,
        start,
        None if noise is None else np.asarray(noise, dtype=float),
        None if conditions is None else Conditions(conditions),
    )
    return Simulation(times, output, model.output_names)
