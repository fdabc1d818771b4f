"""Recursive estimation of polynomial models, sample by sample: for records and for nodes."""

from __future__ import annotations

from idloop.estimate.recursion.estimator import RecursivePolynomial
from idloop.estimate.recursion.families import (
    pseudo_linear_regression,
    recursive_armax,
    recursive_arx,
    recursive_box_jenkins,
    recursive_output_error,
    recursive_prediction_error,
)
from idloop.estimate.recursion.history import CoefficientHistory, track

__all__ = [
    "CoefficientHistory",
    "RecursivePolynomial",
    "pseudo_linear_regression",
    "recursive_armax",
    "recursive_arx",
    "recursive_box_jenkins",
    "recursive_output_error",
    "recursive_prediction_error",
    "track",
]
