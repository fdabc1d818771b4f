"""Estimation: grey-box fits of any model file, and a recursive estimator for the live case."""

from __future__ import annotations

from idloop.estimation.greybox import CRITERIA, fit
from idloop.estimation.result import FitResult, RecordResidual

__all__ = ["CRITERIA", "FitResult", "RecordResidual", "fit"]
