"""A command that answers to the motion is told from one that only looks like it in few samples."""

from __future__ import annotations

import math

import numpy as np
import pytest

from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.feedback import check


def _axis(seed: int, reference: np.ndarray, *, closed: bool) -> Axis:
    rng = np.random.default_rng(seed)
    period, place, speed = 0.002, 0.0, 0.0
    position, velocity, command = np.empty((3, reference.size))
    for k, wanted in enumerate(reference):
        position[k], velocity[k] = np.round(place + 1e-4 * rng.normal(), 3), speed + 1e-2 * rng.normal()
        command[k] = 40.0 * (wanted - position[k]) - 5.0 * velocity[k] if closed else wanted
        speed += period * ((1.0 if closed else 20.0) * command[k] - 3.0 * speed - 0.5 * math.tanh(speed / 0.01))
        place += period * speed
    time = period * np.arange(reference.size)
    return Axis("j", time, position, velocity, time, command, "j.effort")


def _sines(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle = 2.0 * np.pi * rng.uniform(0.3, 5.0, 5) * 0.002 * np.arange(400)[:, None] + rng.uniform(0.0, 6.0, 5)
    return np.asarray(np.sin(angle).sum(axis=1))


def _ramp(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return 0.01 * np.cumsum(np.where(rng.random(400) < 0.97, 1.0, rng.choice([-60.0, 60.0], 400)))


@pytest.mark.parametrize("reference", [_sines, _ramp, lambda _: 0.01 * np.arange(400.0)])
def test_few_rows_of_a_smooth_command_and_a_staircase_show_no_loop(reference):
    assert not any(check(_axis(seed, reference(seed), closed=False)) for seed in range(30))


def test_a_loop_shows_in_few_rows():
    assert all(check(_axis(seed, _sines(seed), closed=True)) for seed in range(10))


@pytest.mark.parametrize("period", [0.97, 1.03, 1.06])
def test_a_sine_beside_measurements_of_another_clock_shows_no_loop(period):
    """Where the readings are not taken with the commands, in some steps of theirs no command falls."""
    time = 0.002 * np.arange(2000)
    command, speed = np.sin(2.0 * np.pi * time), np.zeros(2000)
    for k in range(1999):
        speed[k + 1] = speed[k] + 0.002 * (20.0 * command[k] - 3.0 * speed[k])
    taken = period * time[:1900] + 0.0007
    place, speed = (np.interp(taken, time, one) for one in (0.002 * np.cumsum(speed), speed))
    assert not check(Axis("j", taken, place, speed, time, command, "j.effort"))


def test_a_noisy_reading_of_a_held_command_shows_no_loop():
    """The motion follows the command and not the noise of its reading: behind a step it says more than the readings."""
    rng, reference = np.random.default_rng(2), np.repeat(np.random.default_rng(1).uniform(-3.0, 3.0, 30), 100)
    period, place, speed = 0.002, 0.0, 0.0
    position, velocity = np.empty((2, reference.size))
    for k, force in enumerate(reference):
        position[k], velocity[k] = round(place, 5), round(speed, 4)
        speed += period * (50.0 * force - 5.0 * speed - 5.0 * math.tanh(speed / 0.01))
        place += period * speed
    time = period * np.arange(reference.size)
    command = reference + 0.05 * rng.normal(size=reference.size)
    assert check(Axis("j", time, position, velocity, time, command, "j.effort")) == []
