"""A command that was measured acts around its stamps; a held one from them on, in open loop and in closed loop."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.records.inspection.measured_input import KIND, measured_input

STEP, FINE = 0.01, 20
COUNT = 2000
INERTIA, DRAG, DRY = 0.02, 0.04, 0.02


def excitation(rng: np.random.Generator) -> np.ndarray:
    return 0.5 * lfilter([0.1], [1.0, -0.9], rng.normal(size=COUNT))


def moved(torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity at every sample, the torque given at every fine step."""
    position, velocity = np.zeros(COUNT), np.zeros(COUNT)
    q = v = 0.0
    for k in range(COUNT):
        position[k], velocity[k] = q, v
        for value in torque[k * FINE : (k + 1) * FINE]:
            v += STEP / FINE / INERTIA * (value - DRAG * v - DRY * math.tanh(v / 0.02))
            q += STEP / FINE * v
    return position, velocity


def said(command: np.ndarray, motions: dict[str, np.ndarray]) -> list[str]:
    time = STEP * np.arange(COUNT)
    return [one.kind for one in measured_input("j.effort", time, command, time, motions)]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("field", ["position", "velocity"])
@pytest.mark.parametrize("measured", [False, True])
def test_a_measured_command_is_told_from_a_held_one(measured: bool, field: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    command = np.convolve(excitation(rng), np.hanning(12) / np.sum(np.hanning(12)), mode="same")
    at = np.arange(COUNT * FINE) / FINE
    torque = np.interp(at, np.arange(COUNT), command) if measured else command[at.astype(int)]
    position, velocity = moved(torque)
    motion = {"position": position, "velocity": velocity}[field]
    assert said(command, {f"j.{field}": motion}) == ([KIND] if measured else [])


@pytest.mark.parametrize("seed", range(20))
def test_a_held_command_of_a_noisy_loop_is_not_taken_for_a_measured_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    reference, noise = np.cumsum(excitation(rng)) * STEP, rng.normal(size=(COUNT, 2)) * [1e-4, 1e-2]
    command, output = np.zeros(COUNT), np.zeros((COUNT, 2))
    q = v = 0.0
    for k in range(COUNT):
        output[k] = np.array([q, v]) + noise[k]
        command[k] = 4.0 * (reference[k] - output[k, 0]) - 0.3 * output[k, 1]
        for _ in range(FINE):
            v += STEP / FINE / INERTIA * (command[k] - DRAG * v - DRY * math.tanh(v / 0.02))
            q += STEP / FINE * v
    assert said(command, {"j.position": output[:, 0], "j.velocity": output[:, 1]}) == []


def test_nothing_is_said_where_the_rates_differ_or_the_command_explains_nothing() -> None:
    rng = np.random.default_rng(1)
    time = STEP * np.arange(COUNT)
    command, motion = excitation(rng), rng.normal(size=COUNT)
    assert said(command, {"j.velocity": motion}) == []
    assert measured_input("j.effort", time[::5], command[::5], time, {"j.velocity": motion}) == []
    assert measured_input("j.effort", time, command, time, {"j.effort": motion}) == []
