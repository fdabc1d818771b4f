"""A motor with dry friction, healthy and worn, in runs short enough for tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from idloop.diagnosis.design.experiment import Experiment
from idloop.monitoring import Baseline, choose_watches, learn
from idloop.physics import Model, load_model
from idloop.records import Record

LEVEL, VISCOUS = "coulomb_friction@motor.level", "motor.viscous_friction"


@pytest.fixture(scope="session")
def model() -> Model:
    """A DC motor with good sensors."""
    found = load_model("dc_motor").with_effects(["coulomb_friction@motor(level=0.8)"])
    outputs = tuple(replace(o, noise=n) for o, n in zip(found.outputs, (0.005, 0.02), strict=True))
    return replace(found, outputs=outputs, controller=None)


@pytest.fixture(scope="session")
def run(model) -> Callable[..., Record]:
    """Simulate a run of the motor, its dry friction higher by so much [N·m], its viscous friction by a factor."""

    def simulate(
        seconds: float, seed: int, growth: float = 0.0, viscous: float = 1.0, start_ns: int = 0, **signal: object
    ) -> Record:
        given = {"name": "multilevel", "amplitude": 3.0, "sample_time": 0.01, "duration": seconds, "seed": seed}
        given = given if not signal else {"sample_time": 0.01, "duration": seconds, **signal}
        other = {LEVEL: model.values[LEVEL] + growth, VISCOUS: viscous * model.values[VISCOUS]}
        machine = model.with_values(other)
        record = Experiment(given).run(machine, noise=True, disturbance=0.2, seed=seed, name=f"run{seed}")
        return replace(record, start_ns=start_ns)

    return simulate


@pytest.fixture(scope="session")
def baseline(model, run) -> Baseline:
    """Friction is watched for 15 % of growth, after four minutes of health."""
    return learn(model, [run(240.0, 1)], choose_watches(model, [f"{LEVEL}=15%"]), false_alarm_hours=10.0)
