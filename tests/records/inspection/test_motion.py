"""Motion is told from noise, reversals are counted without the noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.records.inspection.motion import analyse_motion, reversals


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
