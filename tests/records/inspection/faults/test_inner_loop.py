"""A command that a loop in the drive follows is no force, however softly the motion follows it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from idloop.records.inspection.faults.inner_loop import check, unit_of_set_point


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
    (found,) = check(_looped(make_axis, stiffness, damping, "-"))
    assert "set-point of the position" in found.text
    assert unit_of_set_point(found) == "rad"
    assert found.evidence["gain"] == pytest.approx(1.0, abs=0.02)


def test_a_force_is_no_set_point(make_axis):
    assert check(replace(make_axis(), units={})) == []


@pytest.mark.parametrize("unit", ["", "-"])
@pytest.mark.parametrize(("name", "factor"), [("rad/s", 1.0), ("rpm", 30.0 / np.pi), ("deg/s", 180.0 / np.pi)])
def test_a_set_point_of_the_velocity_without_a_unit(make_axis, unit, name, factor):
    set_point = np.repeat(np.random.default_rng(2).normal(size=60), 50)
    axis = make_axis(command=set_point)
    late = np.concatenate([np.full(4, set_point[0]), set_point[:-4]])
    axis = replace(axis, position=None, velocity=late, command=factor * set_point)
    (found,) = check(replace(axis, units={**axis.units, "j.effort": unit}))
    assert unit_of_set_point(found) == name
    assert "set-point of the velocity" in found.text


def test_a_voltage_may_make_a_speed_of_the_same_number(make_axis):
    set_point = np.repeat(np.random.default_rng(2).normal(size=60), 50)
    axis = make_axis(command=set_point)
    assert check(replace(axis, position=None, velocity=set_point)) == []


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
    assert check(replace(axis, position=position, velocity=velocity, units={})) == []


@pytest.mark.parametrize("count", [100, 150])
def test_a_short_record_shows_a_set_point_that_is_followed_closely(make_axis, count):
    """A ramp of two seconds, as a servo is tested."""
    ramp = np.concatenate([np.linspace(0.0, 0.3, count // 2), np.linspace(0.3, 0.0, count - count // 2)])
    late = np.concatenate([np.zeros(3), ramp[:-3]])
    units = {"j.position": "rad"}
    axis = make_axis(count=count, rate=50.0, command=ramp, position=late, velocity=None, units=units)
    (found,) = check(axis)
    assert unit_of_set_point(found) == "rad"
