"""Limits of rate and speed are named; delays, lags and single stays at the largest speed are not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults import drive_limits

LEVELS = np.repeat(np.sign(np.random.default_rng(3).normal(size=600)), 5)
STEP, SAMPLE = 0.3, 0.005


def later(delay: float) -> Callable[[float], float]:
    """Return a drive that is late by a part of a sample: in that part the old command acts."""
    last = LEVELS[0]

    def apply(value: float) -> float:
        nonlocal last
        applied = (1.0 - delay) * value + delay * last
        last = value
        return float(applied)

    return apply


def slower(decay: float) -> Callable[[float], float]:
    """Return a drive with a lag of first order."""
    applied = 0.0

    def apply(value: float) -> float:
        nonlocal applied
        applied = decay * applied + (1.0 - decay) * value
        return applied

    return apply


def limited(value: Callable[[float], float]) -> Callable[[float], float]:
    """Return a drive that limits the rate of what another one applies."""
    applied = 0.0

    def apply(sent: float) -> float:
        nonlocal applied
        applied += float(np.clip(value(sent) - applied, -STEP, STEP))
        return applied

    return apply


@pytest.mark.parametrize("delay", [0.3, 0.5, 0.82, 1.0])
def test_a_delay_of_part_of_a_sample_is_no_limit(make_axis, delay):
    assert drive_limits.limited_rate(make_axis(command=LEVELS, drive=later(delay))) is None


def test_a_lag_with_a_delay_is_no_limit(make_axis):
    lag, delay = slower(0.5), later(0.6)
    assert drive_limits.limited_rate(make_axis(command=LEVELS, drive=lambda value: lag(delay(value)))) is None


@pytest.mark.parametrize("delay", [0.0, 0.6])
def test_a_limit_is_named_with_and_without_a_delay(make_axis, delay):
    found = drive_limits.limited_rate(make_axis(command=LEVELS, drive=limited(later(delay))))
    assert found.evidence["rate"] == pytest.approx(STEP / SAMPLE, rel=0.2)


def axis(stays: int) -> Axis:
    """Drive an axis up to the largest speed under a large command, and keep it there under a smaller one."""
    time = np.arange(12_000) / 2000.0
    phase = np.mod(time, time[-1] / stays + 1e-9) / (time[-1] / stays)
    speed = np.interp(phase, [0.0, 0.7, 0.75, 0.9, 1.0], [0.0, 7.15, 7.2, 7.15, 0.0])
    command = np.where(phase < 0.75, 2.5, 1.7)
    noisy = speed + 0.1 * np.random.default_rng(0).normal(size=time.size)
    units = {"j.velocity": "rad/s", "j.effort": "V"}
    return Axis("j", time, None, noisy, time, command, "j.effort", units)


@pytest.mark.parametrize(("stays", "named"), [(1, False), (3, True)])
def test_a_speed_that_is_reached_several_times_is_a_limit(stays, named):
    assert bool(drive_limits.limited_speed(axis(stays))) == named


def arm(limit: float) -> Axis:
    """Swing an arm under its weight by a loop of a large gain, faster and faster; the drive has a limit of its own."""
    rate, largest, weight = 1000.0, 200.0, 35.0
    time = np.arange(30_000) / rate
    target = 1.4 * np.sin(2.0 * np.pi * (0.1 * time + 2.5 / 30.0 * time**2))
    position, command = np.zeros(time.size), np.zeros(time.size)
    p = v = smooth = 0.0
    for k in range(time.size):
        position[k] = p
        smooth += 0.3 * (v - smooth)
        command[k] = np.clip(600.0 * (target[k] - p) - 40.0 * smooth, -largest, largest)
        applied = float(np.clip(command[k], -limit, limit))
        for _ in range(4):
            v += (applied - weight * np.sin(p - 0.6) - 1.2 * v - 12.0 * np.tanh(v / 0.02)) / (4.0 * rate)
            p += v / (4.0 * rate)
    step = 2.0 * np.pi / 16384
    counts = step * np.floor(position / step)
    units = {"j.position": "rad", "j.effort": "A"}
    return Axis("j", time, counts, None, time, command, "j.effort", units)


@pytest.mark.parametrize(("limit", "named"), [(1000.0, False), (100.0, True)])
def test_the_weight_of_an_arm_is_no_limit_of_the_force(limit, named):
    assert bool(drive_limits.limited_force(arm(limit))) == named
