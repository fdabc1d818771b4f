"""Simulated experiments for the estimators."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from idloop.physics import Model, load_model
from idloop.physics.engine import Engine
from idloop.records import Record

STEP = 0.01


@pytest.fixture(scope="session")
def motor() -> Model:
    """DC motor with Coulomb friction; gain, viscous friction and level are free."""
    return load_model("dc_motor").with_effects(["coulomb_friction@motor(level=0.8)"])


@pytest.fixture(scope="session")
def experiment() -> Callable[..., Record]:
    """Factory of simulated open-loop records under random command levels."""

    def make(model: Model, samples: int = 1500, seed: int = 0, noise: bool = True, **changes: Any) -> Record:
        rng = np.random.default_rng(seed)
        time = np.asarray(np.arange(samples) * STEP, dtype=np.float64)
        command = np.repeat(rng.uniform(-3.0, 3.0, samples // 40 + 1), 40)[:samples]
        output = Engine(model).simulate(None, time, command, time)
        if noise:
            output += rng.normal(size=output.shape) * [o.noise for o in model.outputs]
        values = {
            "name": f"simulated-{seed}",
            "input_time": time,
            "input": command,
            "time": time,
            "output": output,
            "input_name": model.input.name,
            "input_unit": model.input.unit,
            "output_names": model.output_names,
            "output_units": tuple(o.unit for o in model.outputs),
        }
        return Record(**{**values, **changes})

    return make
