"""Information criteria, and the effective number of independent samples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from idloop.estimation.black_box.identification import identify
from idloop.estimation.black_box.method import Choices
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.statistics.information_criteria import comparable, independent_share, of_errors


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


@pytest.mark.slow
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


@given(st.floats(-12.0, 12.0), st.lists(st.integers(1, 40), min_size=2, max_size=6, unique=True))
def test_the_least_criterion_does_not_know_the_unit(decades: float, starts: list[int]) -> None:
    """A model that begins later than another has fewer errors; each counted with ln V, which goes with the unit."""
    errors = np.random.default_rng(1).normal(size=(500, 1))
    chosen = []
    for unit in (1.0, 10.0**decades):
        several = comparable([of_errors(unit * (1.0 + 0.05 / first) * errors[first:], first) for first in starts])
        for name in ("aic", "bic"):
            values = np.array([getattr(one, name) for one in several])
            chosen.append(values - values[0])
    np.testing.assert_allclose(chosen[2:], chosen[:2], rtol=1e-6, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["arx", "armax", "bj", "n4sid"])
def test_the_order_does_not_depend_on_the_unit_of_the_output(method: str) -> None:
    rng = np.random.default_rng(0)
    u = rng.choice([-1.0, 1.0], 1000)
    clean = lfilter([0.0, 0.1, 0.07], [1.0, -1.5, 0.7], u)
    y = clean + lfilter([1.0, 0.5], [1.0, -0.9], 0.1 * rng.normal(size=1000))
    orders = []
    for unit in (1e-6, 1.0, 1e6):
        found = identify(SampledData("run", u[:, None], unit * y[:, None], 0.01), method, Choices())
        orders.append(found.model.order)
    assert orders[0] == orders[1] == orders[2]
