import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from idloop.estimation.statistics.whitening import choose_order, fit_whitener
from idloop.validation.residual import ljung_box


def test_finds_a_known_autoregression() -> None:
    rng = np.random.default_rng(0)
    e = lfilter([1.0], [1.0, -1.5, 0.7], rng.normal(size=20_000))[:, None]
    whitener = fit_whitener([e], 2)
    assert whitener.coefficients[:, 0, 0] == pytest.approx([1.5, -0.7], abs=0.03)
    assert ljung_box(whitener.apply(e)[:, 0], 20)[1] > 0.01


def test_order_of_white_noise_is_low_and_of_colour_is_not() -> None:
    rng = np.random.default_rng(1)
    white = [rng.normal(size=(2000, 2)), rng.normal(size=(1000, 2))]
    assert choose_order(white) <= 1
    assert choose_order([lfilter([1.0], [1.0, -0.9], white[0], axis=0)]) >= 1


def test_short_residuals_are_left_as_they_are() -> None:
    assert choose_order([np.ones((15, 1))]) == 0


@given(st.integers(0, 1000), st.integers(1, 8))
def test_whitening_never_raises_the_determinant(seed: int, order: int) -> None:
    rng = np.random.default_rng(seed)
    e = lfilter([1.0, 0.5], [1.0, -0.8], rng.normal(size=(600, 2)) @ rng.normal(size=(2, 2)), axis=0)
    w = fit_whitener([e], order).apply(e)
    before, after = e.T @ e / len(e), w.T @ w / len(w)
    assert np.linalg.slogdet(after)[1] < np.linalg.slogdet(before)[1] + 0.05


def test_gap_between_records_is_not_bridged() -> None:
    a, b = np.zeros((50, 1)), np.ones((50, 1))
    whitener = fit_whitener([a, b], 1)
    assert np.ptp(whitener.apply(b)) == 0.0


@pytest.mark.parametrize("order", [1, 4, 32])
def test_the_order_is_kept_for_a_singular_covariance(order):
    e = np.zeros((200, 1))
    w = fit_whitener([e], order)
    assert w.order == order
    assert len(w.apply(e)) == 200 - order
