"""A command that is the motion itself is named; one that moves the axis is not, however light the axis is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.records.inspection.faults import copied_motion
from idloop.records.inspection.faults.checks import inspect_axis


def late(value, samples):
    return np.concatenate([np.full(samples, value[0]), value[: value.size - samples]])


COPIES = {
    "the velocity": lambda axis: axis.velocity,
    "in counts of a PWM": lambda axis: 255.0 * axis.velocity,
    "turned, beside a constant": lambda axis: 3.0 - 0.1 * axis.velocity,
    "one sample late": lambda axis: late(axis.velocity, 1),
    "the position": lambda axis: 7.0 * axis.position + 2.0,
}


@pytest.mark.parametrize("copy", COPIES)
@pytest.mark.parametrize("kept", [True, False])
def test_a_copy_of_the_motion_is_no_command(make_axis, copy, kept):
    axis = make_axis()
    axis = replace(axis, command=COPIES[copy](axis), velocity=axis.velocity if kept else None)
    found = [one for one in inspect_axis(axis) if one.kind == copied_motion.KIND]
    assert len(found) == 1
    assert found[0].spoils == ("identification",)
    assert "--command COLUMN" in found[0].cure


@pytest.mark.parametrize("lag", [0.02, 0.5, 3.0, 30.0])
@pytest.mark.parametrize("kind", ["steps", "sines"])
def test_a_command_that_an_axis_without_friction_follows_is_no_copy(make_axis, lag, kind):
    axis = make_axis()
    rng = np.random.default_rng(3)
    fine, turns = np.arange(axis.time.size * 20) / 20.0, rng.uniform(0.005, 0.05, size=6)
    waves = np.sum([np.sin(turn * np.floor(fine) + k) for k, turn in enumerate(turns)], axis=0)
    command = np.repeat(rng.normal(size=75), 40 * 20) if kind == "steps" else waves
    velocity, decay, speed = np.empty(command.size), np.exp(-0.05 / lag), 0.0
    for k, value in enumerate(command):
        velocity[k] = speed
        speed = decay * speed + (1.0 - decay) * value
    position = np.cumsum(velocity) / 20.0
    still = replace(
        axis,
        command=command[::20],
        position=position[::20] * axis.period + 1e-5 * rng.normal(size=axis.time.size),
        velocity=velocity[::20] + 1e-3 * rng.normal(size=axis.time.size),
    )
    assert copied_motion.check(still) == []
    assert copied_motion.check(replace(still, velocity=None)) == []
