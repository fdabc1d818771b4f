"""The Granger test of the command: its detection rate and its false alarms on data with and without a response."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.conftest import RATE, record_of

from idloop.diagnosis.screening.granger_test import granger_causes
from idloop.physics import Model, load_model
from idloop.records import Record

EFFECTS = {
    "friction": ["coulomb_friction@axis(level=0.3)"],
    "late": ["input_delay@input(delay=0.4)"],
    "slow": ["actuator_lag@input(time_constant=0.3)"],
}


def machine(name: str) -> Model:
    return load_model("axis").with_effects(EFFECTS[name])


def unrelated(seed: int) -> Record:
    run, other = (record_of(machine("friction"), one, seconds=20.0, disturbance=0.02) for one in (seed, seed + 1000))
    return replace(run, input=other.input)


@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_command_that_moves_the_axis_does_however_late_and_in_whatever_sense(name, turn):
    record = record_of(machine(name), 3, seconds=20.0, disturbance=0.02)
    assert granger_causes([replace(record, input=turn * record.input)])


def test_it_does_under_a_disturbance_as_strong_as_the_command():
    assert granger_causes([record_of(machine("friction"), 3, seconds=20.0, disturbance=1.0)])


def test_it_does_where_the_drive_of_a_servo_gives_all_it_has():
    """A position loop whose drive saturates: the command is far from the motion, and no linear model near it."""
    time = np.arange(0.0, 6.0, 0.02)
    command = 0.6 * np.sign(np.sin(2.0 * np.pi * (0.3 + 0.15 * time) * time))
    position = np.zeros_like(time)
    for k in range(2, len(time)):
        speed = np.clip(15.0 * (command[k - 2] - position[k - 1]), -1.5, 1.5)
        position[k] = position[k - 1] + 0.02 * speed
    position += 5e-4 * np.random.default_rng(0).normal(size=len(time))
    record = Record("servo", time, command, time, position[:, None], "axis.effort", "rad", ("axis.position",), ("rad",))
    assert granger_causes([record])


@pytest.mark.slow
def test_one_of_another_run_hardly_ever_does():
    assert sum(granger_causes([unrelated(seed)]) for seed in range(40)) <= 2


def test_a_constant_command_or_an_empty_record_shows_no_response():
    record = record_of(machine("friction"), 3, seconds=20.0)
    assert not granger_causes([replace(record, input=np.full_like(record.input, 0.3))])
    few = int(0.1 * RATE)
    short = replace(record, time=record.time[:few], output=record.output[:few])
    assert not granger_causes([short])
    assert not granger_causes([replace(record, output=np.full_like(record.output, np.nan))])
