"""An axis with friction in open loop, as the checks of a recording get it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from idloop.records.inspection.axis import Axis


@pytest.fixture
def make_axis() -> Callable[..., Axis]:
    """Return a function that simulates an axis under random steps and records it cleanly, or as the arguments say."""

    def make(
        seed: int = 0,
        count: int = 3000,
        rate: float = 200.0,
        gain: float = 50.0,
        drive: Callable[[float], float] | None = None,
        size: float = 1.0,
        command: np.ndarray | None = None,
        **changes: object,
    ) -> Axis:
        rng = np.random.default_rng(seed)
        sent = np.repeat(rng.normal(size=count // 40 + 1), 40)[:count] if command is None else command
        position, velocity, p, v = np.empty(count), np.empty(count), 0.0, 0.0
        for k in range(count):
            position[k], velocity[k] = p, v
            applied = float(sent[k]) if drive is None else drive(float(sent[k]))
            for _ in range(4):
                v += 0.25 / rate * (gain * applied - 5.0 * v - 4.0 * math.tanh(v / 0.01))
                p += 0.25 / rate * v
        position = size * (position + 2e-5 * np.std(position) * rng.normal(size=count))
        velocity = size * (velocity + 2e-3 * np.std(velocity) * rng.normal(size=count))
        time = np.arange(count) / rate
        units = {"j.position": "rad", "j.velocity": "rad/s", "j.effort": "V"}
        given = {"position": position, "velocity": velocity, "input_time": time, "command": sent, "units": units}
        return Axis(**{"joint": "j", "time": time, "command_name": "j.effort", **given, **changes})  # type: ignore[arg-type]

    return make
