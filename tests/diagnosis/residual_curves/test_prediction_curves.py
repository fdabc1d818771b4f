"""Which curves of the prediction errors are worth a name."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from idloop.diagnosis.residual_curves.prediction_curves import PredictionCurve


@pytest.mark.parametrize(
    ("of", "height", "matters"), [("force", 0.005, False), ("force", 0.05, True), ("viscous friction", 0.005, True)]
)
def test_a_force_that_is_next_to_nothing_beside_that_of_the_drive_is_no_structure(
    of: str, height: float, matters: bool
):
    screen: Any = SimpleNamespace(estimation=SimpleNamespace(force=1.0))
    fitted: Any = SimpleNamespace(value=np.array([-height, np.nan, 0.5 * height]), curve=SimpleNamespace(of=of))
    nothing: Any = None
    curve = PredictionCurve(screen, fitted, nothing, nothing, nothing)
    assert (curve.improvement >= 0.01) is matters
