"""Validation: fit measures, residual tests, drive-side error, where a model fails."""

from __future__ import annotations

from idloop.validate.compare import Comparison, compare
from idloop.validate.drive import ForceError, force_error
from idloop.validate.measures import fit_percent, measures, nrmse, rmse
from idloop.validate.residual import ResidualTest, residual_tests

__all__ = [
    "Comparison",
    "ForceError",
    "ResidualTest",
    "compare",
    "fit_percent",
    "force_error",
    "measures",
    "nrmse",
    "residual_tests",
    "rmse",
]
