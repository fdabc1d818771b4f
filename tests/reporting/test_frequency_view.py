"""Poles in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from idloop.reporting.frequency_view import FrequencyView


def texts(*poles: complex) -> list[str]:
    nothing: Any = None
    return FrequencyView(nothing, nothing, np.array(poles, dtype=complex)).pole_texts


def test_a_pole_that_is_rounding_error_is_an_integrator() -> None:
    assert texts(-5.99, 1.16e-14, complex(-14.5, 108.0), complex(-14.5, -108.0)) == [
        "0 (integrator)", "−5.99 1/s", "17.3 Hz, damping ratio 0.133",
    ]  # fmt: skip
    assert texts(-1e-3, -2.0) == ["−0.001 1/s", "−2 1/s"]
    assert texts() == []
