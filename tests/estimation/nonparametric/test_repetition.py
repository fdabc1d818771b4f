"""Periods that are claimed, against signals that have one and signals that have none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.estimation.nonparametric.periodic import misfit, mismatches, repetition


def periodic(period: int, times: float, seed: int = 0, noise: float = 0.0, top: int | None = None):
    random = np.random.default_rng(seed)
    lines = np.arange(1, top or period // 2)
    place = np.arange(round(times * period))
    waves = np.cos(2.0 * np.pi * (np.outer(place, lines) / period + random.uniform(size=lines.size)))
    signal = np.sum(waves, axis=1)
    return signal + noise * np.std(signal) * random.normal(size=place.size)


def test_mismatches_are_what_a_shift_changes():
    signal = np.random.default_rng(0).normal(size=200) + 3.0
    centred = signal - signal.mean()
    miss = mismatches(signal)
    assert miss.shape == (101,)
    for lag in (1, 17, 100):
        late, early = centred[lag:], centred[:-lag]
        assert miss[lag] == pytest.approx(np.sum((late - early) ** 2) / np.sum(late**2 + early**2))


@given(
    period=st.integers(20, 200), times=st.floats(2.2, 6.0), seed=st.integers(0, 99), noise=st.sampled_from([0.0, 0.02])
)
def test_the_period_of_a_multisine_is_found(period: int, times: float, seed: int, noise: float):
    assert repetition(periodic(period, times, seed, noise)) == period


def test_what_never_comes_back_has_no_period():
    noise = np.random.default_rng(0).normal(size=1000)
    assert repetition(noise) is None
    assert repetition(np.zeros(100)) is None
    mismatch, own = misfit(noise, 100)
    assert mismatch == pytest.approx(1.0, abs=0.2)
    assert own is None


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_period_fits_and_so_do_its_multiples(noise: float):
    signal = periodic(100, 8.0, 1, noise, top=20)
    assert misfit(signal, 100) is None
    assert misfit(signal, 300) is None
    for wrong in (50, 99, 101, 150, 250):
        assert misfit(signal, wrong)[1] == 100
    assert misfit(signal, 500) is None


@pytest.mark.parametrize("seed", range(5))
def test_a_period_one_sample_off_is_told_under_heavy_noise(seed: int):
    # A quarter of the power is noise: the right period misses nearly as much as its neighbours do.
    signal = periodic(200, 6.0, seed, noise=0.6, top=40)
    for wrong in (199, 201):
        assert misfit(signal, wrong)[1] == 200
    for right in (200, 400):
        assert misfit(signal, right) is None


@pytest.mark.parametrize("seed", range(5))
def test_noise_makes_no_period_of_its_own(seed: int):
    slow = periodic(100, 4.0, seed, noise=0.6, top=5)
    assert misfit(slow, 100) is None
