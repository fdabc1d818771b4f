"""Criteria of errors, and how many of coloured ones count."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from idloop.estimate.identification import identify
from idloop.estimate.information import independent_share, of_errors
from idloop.estimate.sampled import SampledData


@pytest.mark.parametrize("pole", [0.0, 0.5, 0.9])
def test_the_share_of_independent_samples_is_that_of_theory(pole: float) -> None:
    shares = [
        independent_share(lfilter([1.0], [1.0, -pole], np.random.default_rng(seed).normal(size=(5000, 2)), axis=0))
        for seed in range(20)
    ]
    assert np.median(shares) == pytest.approx((1.0 - pole) / (1.0 + pole), rel=0.15)


@given(st.integers(0, 2**32 - 1), st.integers(2, 200), st.integers(1, 3))
@settings(max_examples=50)
def test_a_share_is_one(seed: int, count: int, outputs: int) -> None:
    errors = np.cumsum(np.random.default_rng(seed).normal(size=(count, outputs)), axis=0)
    assert 0.0 < independent_share(errors) <= 1.0
    assert independent_share(np.ones((count, outputs))) == 1.0


def test_loss_is_the_determinant() -> None:
    errors = np.random.default_rng(0).normal(size=(1000, 2)) * (1.0, 2.0)
    assert of_errors(errors, 3).loss == pytest.approx(4.0, rel=0.2)


def test_coloured_noise_does_not_raise_the_order_of_output_errors() -> None:
    orders = []
    for seed in range(6):
        random = np.random.default_rng(seed)
        command = np.repeat(random.choice([-1.0, 1.0], 1000), 3)
        clean = lfilter([0.0, 0.1, 0.05], [1.0, -1.5, 0.7], command)
        noise = lfilter([1.0], [1.0, -0.95], random.normal(size=3000))
        output = clean + 0.1 * np.std(clean) * noise / np.std(noise)
        data = SampledData("coloured", command[:, None], output[:, None], 0.01)
        orders.append(identify(data, "oe").order)
    assert orders.count(2) >= 5
