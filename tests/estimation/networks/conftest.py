"""Nonlinear plants of known equations for the networks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit

from idloop.estimation.black_box.sampled import SampledData

SAMPLE_TIME = 0.05


@njit
def _narx(u, noise):
    y = np.zeros(u.size)
    for k in range(2, u.size):
        y[k] = 0.6 * y[k - 1] - 0.15 * y[k - 2] + 0.5 * np.tanh(2.0 * u[k - 1]) + 0.3 * y[k - 1] * u[k - 2] + noise[k]
    return y


@njit
def _speed(u, steps, step):
    """Speed of a motor with dry friction that holds it still under small commands."""
    y, v = np.zeros(u.size), 0.0
    for k in range(u.size):
        y[k] = v
        for _ in range(steps):
            v += step * (4.0 * u[k] - 4.0 * v - 3.0 * np.tanh(v / 0.02))
    return y


def pack(u, y, name="made", sample_time=SAMPLE_TIME):
    u, y = (np.asarray(v, dtype=float).reshape(len(u), -1) for v in (u, y))
    return SampledData(name, u, y, sample_time, ("u",), ("V",), ("y",), ("rad",))


def levels(seed, samples, held=4, amplitude=1.0):
    return np.repeat(np.random.default_rng(seed).uniform(-amplitude, amplitude, samples // held + 1), held)[:samples]


def narx(seed, samples=2000, noise=0.02):
    u = levels(seed, samples)
    return pack(u, _narx(u, noise * np.random.default_rng(1000 + seed).normal(size=samples)), f"narx-{seed}")


def motor(seed, samples=3000, amplitude=5.0, noise=0.002):
    u = levels(seed, samples, 8, amplitude)
    y = _speed(u, 40, SAMPLE_TIME / 40)
    return pack(u, y + noise * np.random.default_rng(2000 + seed).normal(size=samples), f"motor-{seed}")


def linear(seed, samples=1000, noise=0.1):
    random = np.random.default_rng(seed)
    u, y = random.normal(size=samples), np.zeros(samples)
    e = noise * random.normal(size=samples)
    for k in range(2, samples):
        y[k] = 1.5 * y[k - 1] - 0.7 * y[k - 2] + 1.0 * u[k - 1] + 0.5 * u[k - 2] + e[k]
    return pack(u, y, f"linear-{seed}")


@pytest.fixture(scope="session")
def plant():
    """Makers of experiments on known plants."""
    return SimpleNamespace(pack=pack, narx=narx, motor=motor, linear=linear, levels=levels)
