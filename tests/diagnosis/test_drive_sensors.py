"""Sensors as drives have them: a filtered velocity, encoder counts, and a motion by another integration method."""

import numpy as np
import pytest
from numba import njit

from idloop.diagnosis import refine
from idloop.physics import load_model
from idloop.records import Record

STEP, SUBSTEPS = 1e-3, 10
INERTIA, VISCOUS, COULOMB = 2e-4, 1e-3, 0.02


@njit
def moved(command, lag):
    """Position and filtered velocity by semi-implicit Euler steps, which are early by half a step."""
    inner = STEP / SUBSTEPS
    position = velocity = filtered = 0.0
    found = np.empty((len(command), 2))
    for i in range(len(command)):
        found[i, 0], found[i, 1] = position, filtered
        for _ in range(SUBSTEPS):
            left = command[i] - VISCOUS * velocity
            if velocity == 0.0 and abs(left) <= COULOMB:
                continue
            sign = np.sign(velocity) if velocity != 0.0 else np.sign(left)
            after = velocity + (left - COULOMB * sign) / INERTIA * inner
            velocity = 0.0 if velocity * after < 0.0 else after
            position += velocity * inner
            filtered += (velocity - filtered) * inner / lag
    return found


def recorded(seed, lag, seconds=12.0):
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, STEP)
    command = 0.1 * rng.uniform(-1.0, 1.0, 1000)[(time / 0.15).astype(int)] + 0.04 * np.sin(4.4 * time)
    motion = moved(command, lag)
    count = 2.0 * np.pi / 8192
    output = np.column_stack([np.round(motion[:, 0] / count) * count, motion[:, 1] + 0.05 * rng.normal(size=len(time))])
    return Record(
        f"run{seed}", time, command, time, output, "joint_command", "N·m",
        ("axis.position", "axis.velocity"), ("rad", "rad/s"), start_ns=10**9,
    )  # fmt: skip


@pytest.mark.slow
def test_a_filtered_velocity_and_another_integration_method_make_no_resonance():
    plain = load_model("axis").with_values({"axis.inertia": 1e-4, "axis.viscous_friction": 1e-3})
    found = refine(plain, [recorded(1, 3e-3), recorded(2, 3e-3)])
    # The counts of the encoder are no error of the model.
    assert set(found.added) - {"sensor_quantisation@position[axis]"} == {
        "coulomb_friction@axis",
        "velocity_filter@velocity[axis]",
    }
    values = found.model.values
    assert values["axis.inertia"] == pytest.approx(INERTIA, rel=2e-3)
    assert values["coulomb_friction@axis.level"] == pytest.approx(COULOMB, rel=2e-3)
    # The steps of the filter take the new velocity: their mean delay is a step less than the time constant.
    delay = 3e-3 - STEP / SUBSTEPS
    assert values["velocity_filter@velocity[axis].time_constant"] == pytest.approx(delay, rel=0.01)
