"""Which searches go on after their first round."""

from types import SimpleNamespace
from typing import Any

import pytest

from idloop.diagnose.prediction_view import _may_decide


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
    assert _may_decide(first, 40.0) is goes_on
