"""What the data tell apart: differences of the likelihood beside what chance and further parameters make of them."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from idloop.diagnose.evidence import LEAST_DIFFERENCE, difference_deviation, distinguishable, may_decide


def fitted(contributions: NDArray[np.float64], choices: int = 2) -> Any:
    return SimpleNamespace(
        log_likelihood=float(np.sum(contributions)), choices=choices, contributions=lambda: [contributions]
    )


NOISE = np.random.default_rng(0).normal(size=2000)


@pytest.mark.parametrize(("further", "told"), [(0, True), (1, False)])
def test_a_further_parameter_must_gain_what_it_gains_by_chance(further: int, told: bool) -> None:
    steady = np.full(2000, (LEAST_DIFFERENCE + 0.5) / 2000)
    better, worse = fitted(NOISE + steady, 2 + further), fitted(NOISE)
    assert distinguishable(better, worse) is told


def test_a_difference_that_comes_and_goes_tells_nothing() -> None:
    other = fitted(np.random.default_rng(1).normal(size=2000) + 20.0 / 2000)
    deviation = difference_deviation(other, fitted(NOISE))
    assert deviation == pytest.approx(np.sqrt(2.0 * 2000), rel=0.3)
    assert not distinguishable(other, fitted(NOISE))


@pytest.mark.parametrize(
    ("replaces", "slow", "gain", "score", "goes_on"),
    [
        pytest.param("coulomb_friction@axis", False, 0.0, 100.0, True, id="a replacement that is still far off"),
        pytest.param("coulomb_friction@axis", False, 60.0, 1.0, True, id="a replacement that has gained already"),
        pytest.param("coulomb_friction@axis", False, 0.0, 1.0, False, id="a replacement that nothing speaks for"),
        pytest.param(None, True, 0.0, 100.0, False, id="a constant force, which the disturbance stands for"),
        pytest.param(None, False, 0.0, 100.0, True, id="any other effect, by its score"),
        pytest.param(None, False, 60.0, 1.0, False, id="any other effect whose score is nothing"),
    ],
)
def test_what_is_searched_further_after_a_first_round(
    replaces: str | None, slow: bool, gain: float, score: float, goes_on: bool
) -> None:
    proposal = SimpleNamespace(replaces=replaces, effect=SimpleNamespace(slow=slow))
    first: Any = SimpleNamespace(proposal=proposal, gain=gain, statistic=score)
    assert may_decide(first, 40.0) is goes_on
