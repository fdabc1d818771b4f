"""Closed forms of the periodic waves, the step, the constant and zero."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.signals import build_signal


def value(name, **parameters):
    return build_signal(name, **{"sample_time": 0.01, "duration": 2.0, **parameters}).value


def test_sine():
    time = np.arange(200) * 0.01
    expected = 0.5 + 2.0 * np.sin(2.0 * np.pi * 1.7 * time + 0.3)
    got = value("sine", frequency=1.7, phase=0.3, amplitude=2.0, offset=0.5)
    assert np.allclose(got, expected)


def test_square_halves_and_duty():
    assert value("square", frequency=1.0)[:100].tolist() == [1.0] * 50 + [-1.0] * 50
    assert value("square", frequency=1.0, duty=0.3)[:100].tolist() == [1.0] * 30 + [-1.0] * 70


@pytest.mark.parametrize("frequency", [0.7, 1.0, 3.0, 7.0, 10.0, 12.5])
def test_square_of_a_whole_period_never_flickers(frequency):
    signal = build_signal("square", sample_time=0.001, duration=20.0, frequency=frequency)
    holds = np.diff(np.flatnonzero(np.diff(signal.value)))
    assert np.ptp(holds) <= (0 if 500 % frequency == 0 else 1)


def test_triangle_has_constant_slope_and_starts_at_zero():
    got = value("triangle", frequency=1.0, amplitude=2.0)
    assert got[[0, 25, 50, 75]] == pytest.approx([0.0, 2.0, 0.0, -2.0], abs=1e-12)
    assert np.allclose(np.abs(np.diff(got)), 2.0 * 4.0 * 0.01)


def test_saw_rises_and_falls_once_per_cycle():
    got = value("saw", frequency=1.0)
    assert got[[0, 25, 49, 50, 75]] == pytest.approx([0.0, 0.5, 0.98, -1.0, -0.5], abs=1e-12)
    assert np.sum(np.diff(got) < 0.0) == 2


def test_step_and_pulse():
    assert value("step", start=0.5, amplitude=3.0, offset=1.0).tolist() == [1.0] * 50 + [4.0] * 150
    assert value("step", start=0.5, width=0.25).tolist() == [0.0] * 50 + [1.0] * 25 + [0.0] * 125


def test_constant_and_zero():
    assert np.all(value("constant", amplitude=2.0, offset=0.5) == 2.5)
    assert np.all(value("zero", amplitude=2.0, offset=0.5) == 0.5)
