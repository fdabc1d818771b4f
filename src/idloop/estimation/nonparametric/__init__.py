"""Frequency and impulse responses without a model: what the data show before any structure is chosen."""

from __future__ import annotations

from idloop.estimation.nonparametric.best_linear_approximation import (
    fast_best_linear_approximation,
    robust_best_linear_approximation,
)
from idloop.estimation.nonparametric.distortion import Distortion, LineLevels
from idloop.estimation.nonparametric.frequency_response import FrequencyResponse
from idloop.estimation.nonparametric.impulse_response import ImpulseResponse, cra
from idloop.estimation.nonparametric.spectral import etfe, indirect, spa, welch

__all__ = [
    "Distortion",
    "FrequencyResponse",
    "ImpulseResponse",
    "LineLevels",
    "cra",
    "etfe",
    "fast_best_linear_approximation",
    "indirect",
    "robust_best_linear_approximation",
    "spa",
    "welch",
]
