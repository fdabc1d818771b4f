"""Significance of differences of the log-likelihood."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from idloop.estimation.likelihood.likelihood_difference import LEAST_DIFFERENCE, difference_deviation, distinguishable


def fitted(contributions: NDArray[np.float64], choices: int = 2) -> Any:
    return SimpleNamespace(
        log_likelihood=float(np.sum(contributions)), choices=choices, contributions=lambda: [contributions]
    )


NOISE = np.random.default_rng(0).normal(size=2000)


@pytest.mark.parametrize(("further", "significant"), [(0, True), (1, False)])
def test_a_further_parameter_must_gain_more_than_by_chance(further: int, significant: bool) -> None:
    steady = np.full(2000, (LEAST_DIFFERENCE + 0.5) / 2000)
    better, worse = fitted(NOISE + steady, 2 + further), fitted(NOISE)
    assert distinguishable(better, worse) is significant


def test_a_difference_of_changing_sign_is_not_significant() -> None:
    other = fitted(np.random.default_rng(1).normal(size=2000) + 20.0 / 2000)
    deviation = difference_deviation(other, fitted(NOISE))
    assert deviation == pytest.approx(np.sqrt(2.0 * 2000), rel=0.3)
    assert not distinguishable(other, fitted(NOISE))
