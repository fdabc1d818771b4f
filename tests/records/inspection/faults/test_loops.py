"""A set-point, a copy of the motion and a loop without its reference are told from what only looks so."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults import loops
from idloop.records.inspection.faults.checks import inspect_axis


def _looped(make_axis, stiffness, damping, unit):
    """Let a position loop with friction and overshoot follow slow sines."""
    time = np.arange(4000) / 200.0
    set_point = np.sin(2.1 * time) + 0.6 * np.sin(5.3 * time + 1.0) + 0.3 * np.sin(9.7 * time)
    p = v = 0.0
    position, velocity = np.empty(time.size), np.empty(time.size)
    for k, wanted in enumerate(set_point):
        position[k], velocity[k] = p, v
        for _ in range(10):
            force = stiffness * (wanted - p) - damping * v
            v += 5e-4 * (50.0 * force - 5.0 * v - 2.0 * math.tanh(v / 0.01))
            p += 5e-4 * v
    position += 2e-4 * np.random.default_rng(0).normal(size=time.size)
    axis = make_axis(count=time.size, command=set_point)
    return replace(axis, position=position, velocity=velocity, units={**axis.units, "j.effort": unit})


@pytest.mark.parametrize(("stiffness", "damping"), [(3.0, 0.1), (20.0, 0.2)])
def test_a_set_point_that_is_overshot_or_followed_softly_is_none_of_a_force(make_axis, stiffness, damping):
    found = loops.set_point(_looped(make_axis, stiffness, damping, "-"))
    assert "set-point of the position" in found.text
    assert loops.unit_of_set_point(found) == "rad"
    assert found.evidence["gain"] == pytest.approx(1.0, abs=0.02)


def test_a_force_is_no_set_point(make_axis):
    assert loops.set_point(replace(make_axis(), units={})) is None


@pytest.mark.parametrize("unit", ["", "-"])
@pytest.mark.parametrize(("name", "factor"), [("rad/s", 1.0), ("rpm", 30.0 / np.pi), ("deg/s", 180.0 / np.pi)])
def test_a_set_point_of_the_velocity_without_a_unit(make_axis, unit, name, factor):
    set_point = np.repeat(np.random.default_rng(2).normal(size=60), 50)
    axis = make_axis(command=set_point)
    late = np.concatenate([np.full(4, set_point[0]), set_point[:-4]])
    axis = replace(axis, position=None, velocity=late, command=factor * set_point)
    found = loops.set_point(replace(axis, units={**axis.units, "j.effort": unit}))
    assert loops.unit_of_set_point(found) == name
    assert "set-point of the velocity" in found.text


def test_a_voltage_may_make_a_speed_of_the_same_number(make_axis):
    set_point = np.repeat(np.random.default_rng(2).normal(size=60), 50)
    axis = make_axis(command=set_point)
    assert loops.set_point(replace(axis, position=None, velocity=set_point)) is None


@pytest.mark.parametrize("spring", [20.0, 80.0])
def test_a_spring_is_no_loop(make_axis, spring):
    time = np.arange(4000) / 200.0
    command = np.sin(2.1 * time) + 0.6 * np.sin(5.3 * time + 1.0) + 0.3 * np.sin(9.7 * time)
    p = v = 0.0
    position, velocity = np.empty(time.size), np.empty(time.size)
    for k, force in enumerate(command):
        position[k], velocity[k] = p, v
        for _ in range(10):
            v += 5e-4 * (50.0 * force - 5.0 * v - spring * p)
            p += 5e-4 * v
    axis = make_axis(count=time.size, command=command)
    assert loops.set_point(replace(axis, position=position, velocity=velocity, units={})) is None


@pytest.mark.parametrize("count", [100, 150])
def test_a_short_record_shows_a_set_point_that_is_followed_closely(make_axis, count):
    """A ramp of two seconds, as a servo is tested."""
    ramp = np.concatenate([np.linspace(0.0, 0.3, count // 2), np.linspace(0.3, 0.0, count - count // 2)])
    late = np.concatenate([np.zeros(3), ramp[:-3]])
    units = {"j.position": "rad"}
    axis = make_axis(count=count, rate=50.0, command=ramp, position=late, velocity=None, units=units)
    found = loops.set_point(axis)
    assert loops.unit_of_set_point(found) == "rad"


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
    found = [one for one in inspect_axis(axis) if one.kind == loops.COPY]
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
    assert loops.copied_motion(still) is None
    assert loops.copied_motion(replace(still, velocity=None)) is None


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
    assert not any(loops.feedback(_axis(seed, reference(seed), closed=False)) for seed in range(30))


def test_a_loop_shows_in_few_rows():
    assert all(loops.feedback(_axis(seed, _sines(seed), closed=True)) for seed in range(10))


@pytest.mark.parametrize("period", [0.97, 1.03, 1.06])
def test_a_sine_beside_measurements_of_another_clock_shows_no_loop(period):
    """Where the readings are not taken with the commands, in some steps of theirs no command falls."""
    time = 0.002 * np.arange(2000)
    command, speed = np.sin(2.0 * np.pi * time), np.zeros(2000)
    for k in range(1999):
        speed[k + 1] = speed[k] + 0.002 * (20.0 * command[k] - 3.0 * speed[k])
    taken = period * time[:1900] + 0.0007
    place, speed = (np.interp(taken, time, one) for one in (0.002 * np.cumsum(speed), speed))
    assert not loops.feedback(Axis("j", taken, place, speed, time, command, "j.effort"))


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
    assert loops.feedback(Axis("j", time, position, velocity, time, command, "j.effort")) is None
