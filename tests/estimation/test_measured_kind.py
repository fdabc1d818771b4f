"""A measured torque as the input of an exact linear axis: it is fitted, and no effect is missing."""

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnosis import diagnose
from idloop.estimation import fit
from idloop.physics import Model, load_model
from idloop.records import Record

INERTIA, DRAG = 0.02, 0.04


@pytest.fixture(scope="module")
def case() -> tuple[Model, Record]:
    """Smooth torque and the exact motion that it makes, both sampled at 100 Hz."""
    start = load_model("axis")
    model = replace(start, input=replace(start.input, kind="measured"))
    time = np.arange(0.0, 20.0, 0.01)
    rng = np.random.default_rng(0)
    position, velocity, torque = np.zeros((3, len(time)))
    for frequency in (0.31, 0.83, 1.7, 3.1):
        omega, phase = 2.0 * np.pi * frequency, rng.uniform(0.0, 2.0 * np.pi)
        wave = np.exp(1j * (omega * time + phase))
        amplitude = 0.5 / omega
        position += np.real(amplitude * wave)
        velocity += np.real(1j * omega * amplitude * wave)
        torque += np.real((INERTIA * (1j * omega) ** 2 + DRAG * 1j * omega) * amplitude * wave)
    units = tuple(output.unit for output in model.outputs)
    columns = {"position": position, "velocity": velocity}
    output = np.column_stack([columns[o.field] for o in model.outputs])
    output += rng.normal(size=output.shape) * [1e-4, 1e-3]
    record = Record(
        "measured", time, torque, time, output, model.input.name, model.input.unit, model.output_names, units
    )
    return model, record


@pytest.mark.parametrize("criterion", ["auto", "prediction", "simulation", "force"])
def test_a_measured_torque_gives_the_axis_its_values(case: tuple[Model, Record], criterion: str) -> None:
    model, record = case
    found = fit(model, [record], criterion=criterion).model.values
    assert found["axis.inertia"] == pytest.approx(INERTIA, rel=5e-3)
    assert found["axis.viscous_friction"] == pytest.approx(DRAG, rel=5e-3)


def test_an_axis_with_measured_torque_misses_no_effect(case: tuple[Model, Record]) -> None:
    model, record = case
    diagnosis = diagnose(model, [record])
    assert diagnosis.set == ()
    assert diagnosis.verdict == "adequate"


def test_noise_of_the_measured_torque_does_not_bias_the_fit(case: tuple[Model, Record]) -> None:
    model, record = case
    rms = np.sqrt(np.mean(record.input**2))
    found = []
    for seed in range(4):
        noise = 0.5 * rms * np.random.default_rng(seed).normal(size=len(record.input))
        noisy = replace(record, input=record.input + noise)
        result = fit(model, [noisy])
        assert result.criterion == "force"
        found.append([result.model.values[name] for name in ("axis.inertia", "axis.viscous_friction")])
    # Predictions alone find an inertia that is larger by a quarter: the power of the noise.
    assert np.mean(found, axis=0) == pytest.approx([INERTIA, DRAG], rel=0.03)
