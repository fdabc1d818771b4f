"""Which curves of the prediction errors are worth a name."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from idloop.diagnosis.residual_curves.prediction_curves import PredictionCurve


@pytest.mark.parametrize(
    ("of", "heights", "matters"),
    [
        ("force", [-0.005, np.nan, 0.0025], False),
        ("force", [-0.05, np.nan, 0.025], True),
        ("viscous friction", [-0.005, np.nan, 0.005], False),
        ("viscous friction", [-0.05, np.nan, 0.05], True),
        ("viscous friction", [0.5, 0.505, 0.5], False),  # its mean is the model's own parameter
    ],
)
def test_what_makes_a_force_next_to_nothing_beside_that_of_the_drive_is_no_structure(
    of: str, heights: list[float], matters: bool
):
    kind: Any = SimpleNamespace(of=of, coefficient=of != "force", step=0.01)
    fitted: Any = SimpleNamespace(value=np.array(heights), curve=kind)
    nothing: Any = None
    curve = PredictionCurve(nothing, fitted, nothing, nothing, nothing)
    assert (curve.improvement >= 0.01) is matters
