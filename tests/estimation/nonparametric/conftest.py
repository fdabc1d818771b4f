"""The plant that the estimators are held against, and experiments on it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit
from scipy import signal

from idloop.estimation.black_box.sampled import SampledData
from idloop.signals import build_signal

SAMPLE_TIME = 0.01
B, A = [0.0, 0.1, 0.05], [1.0, -1.5, 0.7]
NOISE_POLE = 0.8


def response(frequency):
    return signal.freqz(B, A, 2 * np.pi * frequency * SAMPLE_TIME)[1]


def impulse(lag):
    weights = signal.lfilter(B, A, np.r_[1.0, np.zeros(400)])
    return np.where(lag >= 0, weights[np.maximum(lag, 0)], 0.0)


def disturbance_density(frequency, noise):
    return 2 * SAMPLE_TIME * noise**2 / np.abs(1 - NOISE_POLE * np.exp(-2j * np.pi * frequency * SAMPLE_TIME)) ** 2


def disturbance(seed, samples, noise):
    return noise * signal.lfilter([1.0], [1.0, -NOISE_POLE], np.random.default_rng(seed).normal(size=samples))


def pack(u, y, reference=None, name="made"):
    u, y = (np.asarray(v).reshape(len(u), -1) for v in (u, y))
    return SampledData(name, u, y, SAMPLE_TIME, ("u",), ("V",), ("y",), ("rad",), reference=reference)


def open_loop(seed, samples=8192, noise=0.1, kind="coloured"):
    u = np.random.default_rng(10_000 + seed).normal(size=samples)
    if kind == "coloured":
        u = signal.lfilter([1.0], [1.0, -0.7], u)
    elif kind == "binary":
        u = np.sign(u)
    return pack(u, signal.lfilter(B, A, u) + disturbance(seed, samples, noise))


@njit
def _feedback(reference, noise, gain):
    u, y = np.zeros(reference.size), np.zeros(reference.size)
    x1 = x2 = u1 = u2 = 0.0
    for k in range(reference.size):
        x = 1.5 * x1 - 0.7 * x2 + 0.1 * u1 + 0.05 * u2
        y[k] = x + noise[k]
        u[k] = gain * (reference[k] - y[k])
        x1, x2, u1, u2 = x, x1, u[k], u1
    return u, y


def closed_loop(seed, samples=8192, noise=0.3, reference=None):
    r = np.random.default_rng(20_000 + seed).normal(size=samples) if reference is None else reference
    u, y = _feedback(r, disturbance(seed, r.size, noise), 1.0)
    return pack(u, y, r)


def multisine(seed, grid="full", periods=6, amplitude=1.0):
    return build_signal(
        "multisine", sample_time=SAMPLE_TIME, period=5.12, duration=5.12 * periods, frequency_min=0.2,
        frequency_max=20.0, grid=grid, seed=seed, amplitude=amplitude,
    )  # fmt: skip


def periodic(seed, grid="full", noise=0.01, cubic=0.0, square=0.0, drift=0.0, periods=6):
    sent = multisine(seed, grid, periods)
    u = sent.value
    y = signal.lfilter(B, A, u + cubic * u**3 + square * u**2) + disturbance(seed, u.size, noise)
    return pack(u, y + drift * np.arange(u.size)), sent


@pytest.fixture(scope="session")
def plant():
    """Functions on the known plant."""
    return SimpleNamespace(
        sample_time=SAMPLE_TIME, numerator=B, denominator=A, response=response, impulse=impulse, pack=pack,
        disturbance_density=disturbance_density, disturbance=disturbance, open_loop=open_loop,
        closed_loop=closed_loop, multisine=multisine, periodic=periodic,
    )  # fmt: skip
