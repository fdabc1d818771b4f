"""Motion is told from noise, reversals are counted without the noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.records.inspection.motion import analyse_motion, reversals, white_noise


@given(seed=st.integers(0, 200), scale=st.floats(1e-6, 1e3))
def test_noise_about_one_value_is_no_motion(seed, scale):
    motion = analyse_motion(5 * scale + scale * np.random.default_rng(seed).normal(size=1000))
    assert motion is not None
    assert not motion.moves


@given(seed=st.integers(0, 200), swings=st.integers(1, 9))
def test_reversals_under_noise(seed, swings):
    phase = np.linspace(0, np.pi * swings, 2000)
    value = np.cos(phase) + 0.003 * np.random.default_rng(seed).normal(size=2000)
    assert reversals(value) == swings - 1
    motion = analyse_motion(value)
    assert motion is not None
    assert motion.moves


@given(seed=st.integers(0, 200), swings=st.integers(1, 9))
def test_reversals_of_a_velocity_are_its_changes_of_sign(seed, swings):
    phase = np.linspace(0.1, np.pi * swings - 0.1, 2000)
    # Its turning points are not: they are those of the acceleration.
    value = np.sin(phase) + 0.2 * np.sin(9.0 * phase) + 0.003 * np.random.default_rng(seed).normal(size=2000)
    motion = analyse_motion(value, velocity=True)
    assert motion is not None
    assert motion.reversals == swings - 1


def test_never_measured_and_constant():
    assert analyse_motion(np.full(9, np.nan)) is None
    still = analyse_motion(np.full(9, 2.0))
    assert still is not None
    assert not still.moves
    assert still.resolution == 0.0


def test_rounding_is_no_resolution():
    steps = np.arange(400) % 40
    assert analyse_motion(np.concatenate([steps * 0.1, steps / 10.0])).resolution == pytest.approx(0.1)


def test_resolution_and_infinite_samples():
    motion = analyse_motion(np.array([0.0, 0.25, 1.0, np.inf, np.nan, 0.25]))
    assert motion is not None
    assert motion.resolution == pytest.approx(0.25)
    assert (motion.infinite, motion.count) == (1, 4)


def smooth(count, size):
    time = 0.01 * np.arange(count)
    return size * (np.sin(1.3 * time) + 0.4 * np.sin(3.1 * time + 1.0))


@pytest.mark.parametrize("count", [500, 4000])
@pytest.mark.parametrize("steps", [30.0, 300.0])
@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2, 0.3, 0.5, 1.0, 3.0])
def test_white_noise_of_a_rounded_signal(noise, steps, count):
    """Its steps, its noise, and both together."""
    rng = np.random.default_rng(3)
    value = np.round(smooth(count, steps) + noise * rng.normal(size=count))
    assert white_noise(0.1 * value) == pytest.approx(0.1 * (noise**2 + 1.0 / 12.0) ** 0.5, rel=0.2)


@pytest.mark.parametrize("count", [200, 1000])
def test_white_noise_of_a_signal_with_odd_values(count):
    value = smooth(count, 3.0) + np.random.default_rng(4).normal(size=count)
    value[count // 4] += 1e4
    assert white_noise(value) == pytest.approx(1.0, rel=0.2)
    value[count // 2 :] += 1e8
    assert white_noise(value) == pytest.approx(1.0, rel=0.2)


def test_white_noise_of_counts_per_sample():
    """Rounding moves from one sample to the next and is no noise of the speed over several of them."""
    counts = np.diff(np.round(100.0 * smooth(4000, 30.0)))
    assert white_noise(counts) <= 1.2 * (2.0 / 12.0) ** 0.5
    assert white_noise(counts) >= 0.5 * (2.0 / 12.0) ** 0.5


def test_white_noise_of_few_values():
    assert white_noise(np.zeros(0)) == white_noise(np.ones(2)) == white_noise(np.ones(9)) == 0.0
