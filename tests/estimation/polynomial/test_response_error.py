"""Bands of a frequency response hold the truth as often as they say."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.polynomial import arx, box_jenkins
from idloop.estimation.polynomial.polynomials import response_error

B, A = [0.0, 0.0, 0.4, 0.2], [1.0, -1.2, 0.6]
HZ = np.array([0.02, 0.1, 0.2, 0.4])


def test_the_response_is_that_of_the_state_space():
    data = record(0)
    for model in (arx(data, 2, 2, 2), box_jenkins(data, 2, 1, 1, 2, 2)):
        value, size, angle = response_error(model.polynomials[0], 0, HZ)
        np.testing.assert_allclose(value, model.response(HZ)[:, 0, 0], rtol=1e-9)
        assert np.all(size > 0)
        assert np.all(angle > 0)


def record(seed):
    random = np.random.default_rng(seed)
    u, e = random.normal(size=(2, 600))
    y = lfilter(B, A, u) + lfilter([1.0], A, 0.5 * e)
    return SampledData(f"run {seed}", u[:, None], y[:, None], 1.0)


def test_coverage():
    z = np.exp(-2j * np.pi * HZ)
    truth = np.polyval(B[::-1], z) / np.polyval(A[::-1], z)
    inside = np.zeros((2, len(HZ)))
    runs = 150
    for seed in range(runs):
        value, size, angle = response_error(arx(record(seed), 2, 2, 2).polynomials[0], 0, HZ)
        inside[0] += np.abs(np.abs(value) - np.abs(truth)) < 1.96 * size
        inside[1] += np.abs(np.angle(value / truth)) < 1.96 * angle
    # 95 % of 150 runs: 142.5 with a standard deviation of 2.7.
    assert np.all(inside > 131)
    assert np.mean(inside) < 148
