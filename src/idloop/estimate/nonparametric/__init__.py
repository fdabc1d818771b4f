"""Frequency and impulse responses without a model: what the data says before any structure is chosen."""

from __future__ import annotations

from idloop.estimate.nonparametric.best_linear_approximation import (
    fast_best_linear_approximation,
    robust_best_linear_approximation,
)
from idloop.estimate.nonparametric.blackman_tukey import spa
from idloop.estimate.nonparametric.closed_loop import indirect
from idloop.estimate.nonparametric.correlation import cra
from idloop.estimate.nonparametric.distortion import Distortion, LineLevels
from idloop.estimate.nonparametric.empirical_transfer_function import etfe
from idloop.estimate.nonparametric.frequency_response import FrequencyResponse
from idloop.estimate.nonparametric.impulse_response import ImpulseResponse
from idloop.estimate.nonparametric.welch import welch

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
