"""Detection of feedback, and the methods for open loops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt

from idloop.estimation.black_box.method import Choices
from idloop.estimation.black_box.methods import METHODS
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.feedback import closed_loop_methods, detect_feedback, handles_feedback


def looped(gain=0.5, noise=0.1, seed=0, samples=4000):
    """First-order plant behind u = gain (r - y), or the open loop u = r at no gain."""
    random = np.random.default_rng(seed)
    r = np.repeat(random.choice([-1.0, 1.0], samples // 10), 10)
    y, u, clean = np.zeros(samples), np.zeros(samples), 0.0
    for k in range(samples):
        y[k] = clean + noise * random.normal()
        u[k] = gain * (r[k] - y[k]) if gain else r[k]
        clean = 0.95 * clean + 0.1 * u[k]
    return SampledData("loop", u[:, None], y[:, None], 0.01, reference=r if gain else None)


def test_the_power_of_fed_back_noise_is_estimated():
    loop = detect_feedback(looped())
    assert loop.closed
    assert loop.reference
    assert loop.depends
    # u holds gain times the noise.
    assert loop.fed_back == pytest.approx((0.5 * 0.1) ** 2 / np.var(looped().input), rel=0.3)


@pytest.mark.parametrize(("pole", "gain"), [(0.95, 0.5), (0.99, 2.0), (0.995, 0.5)])
def test_the_power_of_slow_fed_back_noise_is_estimated(pole, gain):
    """Beside the newest sample's noise, that of all samples before it; the truth is the loop without its reference."""
    random, samples = np.random.default_rng(3), 8000
    e = 0.02 * random.normal(size=samples)
    v, r = lfilter([1.0], [1.0, -pole], e), np.repeat(random.choice([-1.0, 1.0], samples // 10), 10)
    commands = []
    for reference in (r, 0.0 * r):
        y, u, clean = np.zeros(samples), np.zeros(samples), 0.0
        for k in range(samples):
            y[k] = clean + v[k]
            u[k] = gain * (reference[k] - y[k])
            clean = 0.95 * clean + 0.1 * u[k]
        commands.append((u, y))
    (u, y), (returned, _) = commands
    loop = detect_feedback(SampledData("loop", u[:, None], y[:, None], 0.01, reference=r))
    assert loop.fed_back == pytest.approx(np.var(returned) / np.var(u), rel=0.25)


def test_a_loop_without_noise_is_closed_without_fed_back_power():
    loop = detect_feedback(looped(noise=1e-4))
    assert loop.closed
    assert loop.fed_back < 1e-6


def test_feedback_shows_without_a_record_of_the_reference():
    # A controller that works on the sample before.
    data = looped()
    late = replace(data, input=np.roll(data.input, 1, axis=0), reference=None).part(1, len(data))
    loop = detect_feedback(late)
    assert loop.depends
    assert not loop.reference


@pytest.mark.parametrize("kind", ("binary", "multisine", "sweep", "coloured", "smooth"))
@pytest.mark.parametrize("friction", (0.0, 0.5))
def test_an_open_loop_is_open_whatever_the_excitation_and_the_plant(kind, friction):
    random, samples = np.random.default_rng(7), 4000
    time = 0.01 * np.arange(samples)
    u = {
        "binary": np.repeat(random.choice([-1.0, 1.0], samples // 5), 5),
        "multisine": sum(np.sin(2 * np.pi * f * time + random.uniform(0, 6)) for f in np.arange(0.1, 10.0, 0.3)),
        "sweep": np.sin(2 * np.pi * (0.1 + 0.1 * time) * time),
        "smooth": sosfiltfilt(butter(4, 0.3, output="sos"), random.normal(size=samples)),
        "coloured": lfilter([1.0], [1.0, -0.95], random.normal(size=samples)),
    }[kind]
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.97 * y[k - 1] + 0.1 * u[k - 1] - 0.05 * friction * np.tanh(20.0 * y[k - 1])
    if friction:
        # A resonance that is no linear one and rings for longer than the regressions look back.
        ringing = np.zeros(samples)
        for k in range(2, samples):
            past = ringing[k - 1]
            ringing[k] = 1.9 * past - 0.98 * ringing[k - 2] - 0.3 * np.tanh(past) + y[k]
        y = ringing
    y /= np.std(y)
    for noise in (1e-3, 0.1):
        data = SampledData("open", u[:, None], (y + noise * random.normal(size=samples))[:, None], 0.01)
        assert not detect_feedback(data).closed


def test_an_unstable_plant_in_open_loop_has_no_feedback():
    random = np.random.default_rng(0)
    u = np.repeat(random.choice([-1.0, 1.0], 1000), 2)
    y = lfilter([0.0, 0.01], [1.0, -1.01], u) + 1e-3 * random.normal(size=2000)
    data = SampledData(
        "away",
        u[:, None],
        np.column_stack([y, np.gradient(y, 0.005)]),
        0.005,
        output_names=("a", "b"),
        output_units=("-", "-"),
    )
    assert not detect_feedback(data).closed


def test_too_few_samples_are_reported_as_undecided():
    loop = detect_feedback(looped(samples=60))
    assert np.isnan(loop.fed_back)
    assert not loop.depends


def test_methods_for_the_open_loop_are_known():
    open_only = {name for name, method in METHODS.items() if not handles_feedback(method, Choices())}
    assert {"spa", "welch", "etfe", "cra", "iv4", "oe", "n4sid", "moesp", "cva", "vodma-direct"} <= open_only
    assert not open_only & {"pbsid", "pem", "bj", "armax", "arx", "vodma", "indirect"}
    assert handles_feedback(METHODS["iv4"], Choices(closed_loop=True))
    assert not handles_feedback(METHODS["pem"], Choices(focus="simulation"))
    assert "indirect" in closed_loop_methods(detect_feedback(looped()))
