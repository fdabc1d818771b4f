"""Validation: fit measures, residual tests, drive-side error, where a model fails."""

from __future__ import annotations

from idloop.validate.breakdown import Breakdown
from idloop.validate.compare import Comparison, compare
from idloop.validate.drive import ForceError, force_error
from idloop.validate.measures import fit_percent, measures, nrmse, rmse
from idloop.validate.residual import ResidualTest, residual_tests
from idloop.validate.stretch import Stretch
from idloop.validate.where import ErrorMap, Where, where

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
    "where",
]
