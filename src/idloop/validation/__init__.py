"""Validation: fit measures, residual tests, drive-side error, where a model fails."""

from __future__ import annotations

from idloop.validation.breakdown import Breakdown
from idloop.validation.compare import Comparison, compare, share_measures
from idloop.validation.drive import ForceError, force_error
from idloop.validation.measures import fit_percent, measures, nrmse, rmse
from idloop.validation.residual import ResidualTest, residual_tests
from idloop.validation.stretch import Stretch
from idloop.validation.where import ErrorMap, Where, where

__all__ = [
    "Breakdown",
    "Comparison",
    "ErrorMap",
    "ForceError",
    "ResidualTest",
    "Stretch",
    "Where",
    "compare",
    "fit_percent",
    "force_error",
    "measures",
    "nrmse",
    "residual_tests",
    "rmse",
    "share_measures",
    "where",
]
