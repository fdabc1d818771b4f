"""A plant of three states, two outputs and coloured noise, in open and closed loop."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear.propagate import respond

STEP = 0.1
FREQUENCY = np.geomspace(0.01, 4.5, 60)


def plant(a=None, b=None, c=None, d=None, gain=None):
    a = np.array([[0.8, 0.4, 0.0], [-0.4, 0.8, 0.0], [0.0, 0.0, 0.5]]) if a is None else np.array(a)
    b = np.array([[0.3], [0.2], [1.0]]) if b is None else np.array(b)
    c = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0]]) if c is None else np.array(c)
    d = np.zeros((len(c), b.shape[1])) if d is None else np.array(d)
    gain = np.array([[0.3, 0.1], [0.0, 0.2], [0.1, 0.1]]) if gain is None else np.array(gain)
    return SimpleNamespace(a=a, b=b, c=c, d=d, gain=gain)


def response(model, frequency=FREQUENCY):
    z = np.exp(2j * np.pi * frequency * STEP)
    return np.array(
        [model.c @ np.linalg.solve(point * np.eye(len(model.a)) - model.a, model.b) + model.d for point in z]
    )


def distance(found, true):
    """Relative error of the frequency response."""
    h = response(true)
    return float(np.linalg.norm(found.response(FREQUENCY) - h) / np.linalg.norm(h))


def experiment(true, samples, noise=0.0, seed=0, feedback=0.0, name="made", start=None):
    """White excitation r in u = r - feedback y_1, and innovations of deviation `noise`."""
    rng = np.random.default_rng(seed)
    n, m = true.b.shape
    p = len(true.c)
    r, e = rng.normal(size=(samples, m)), noise * rng.normal(size=(samples, p))
    # With D zero the loop is linear in (r, e): no recursion over samples is needed here.
    back = np.zeros((m, p))
    back[0, 0] = feedback
    a = true.a - true.b @ back @ true.c
    b = np.hstack([true.b, true.gain - true.b @ back])
    c = np.vstack([true.c, -back @ true.c])
    d = np.block([[true.d, np.eye(p)], [np.eye(m), -back]])
    assert feedback == 0.0 or not np.any(true.d)
    both = respond(a, b, c, d, np.zeros(n) if start is None else np.array(start), np.hstack([r, e]))
    labels = tuple(f"y{i + 1}" for i in range(p))
    return SampledData(
        name,
        both[:, p:].copy(),
        both[:, :p].copy(),
        STEP,
        tuple(f"u{i + 1}" for i in range(m)),
        ("V",) * m,
        labels,
        ("rad",) * p,
    )


@pytest.fixture
def true():
    return plant()


@pytest.fixture
def made() -> Callable[..., SampledData]:
    return experiment
