"""A motor that a loop turns at a steady speed shows the forces of its command, and hardly its inertia."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.diagnosis import refine
from idloop.records import Record
from idloop.records.recognition.model_start import start_model

RATE, SUBSTEPS, SPEED = 1000.0, 4, 5.3
INERTIA, FRICTION = 1.2e-4, 0.016
# Amplitude [A] by harmonic: what the drive's current compensates.
WAVES = {18: 0.042, 24: 0.02}


def turned(seconds: float, seed: int) -> Record:
    """Steady turns by a loop of proportional and integral gain, commanded in amperes."""
    rng, step = np.random.default_rng(seed), 1.0 / RATE / SUBSTEPS
    time = np.arange(0.0, seconds, 1.0 / RATE)
    command, place, rate = (np.zeros(time.size) for _ in range(3))
    position, velocity, integral = rng.uniform(0.0, 6.0), SPEED, FRICTION * SPEED
    for k in range(time.size):
        place[k], rate[k] = position + 1e-4 * rng.normal(), velocity + 0.05 * rng.normal()
        integral += 0.5 * (SPEED - rate[k]) / RATE
        command[k] = 0.02 * (SPEED - rate[k]) + integral
        for _ in range(SUBSTEPS):
            waves = sum(size * np.sin(harmonic * position) for harmonic, size in WAVES.items())
            velocity += step * (command[k] - waves - FRICTION * velocity) / INERTIA
            position += step * velocity
    measured = {"axis.position": place, "axis.velocity": rate}
    return Record.from_arrays(time, command, measured, name=f"run{seed}")


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_waves_are_found_in_units_of_the_command(seed: int) -> None:
    records = [turned(3.0, seed), turned(2.5, seed + 10)]
    model = start_model("motor", "axis", "A", {"position": "rad", "velocity": "rad/s"}, records=records[:1])
    ladder = refine(model, records[:1], records[1:], effects=["cogging", "coulomb_friction", "input_offset"])
    values = ladder.model.values
    found = {values[f"{name}.harmonic"]: values[f"{name}.amplitude"] for name in ladder.added}
    assert found == pytest.approx(WAVES, rel=0.1)
    assert values["axis.viscous_friction"] == pytest.approx(FRICTION, rel=0.02)
    errors = [step.validation["force"] for step in ladder.steps]
    assert errors == sorted(errors, reverse=True)
