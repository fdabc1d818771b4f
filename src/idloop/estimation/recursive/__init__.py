"""Recursive estimation of polynomial models, sample by sample: for records and for nodes."""

from __future__ import annotations

from idloop.estimation.recursive.estimator import RecursivePolynomial
from idloop.estimation.recursive.extended_kalman import ExtendedKalman
from idloop.estimation.recursive.history import CoefficientHistory, track
from idloop.estimation.recursive.live import Coefficient, LiveRecursion
from idloop.estimation.recursive.methods import (
    RECURSIVE_METHODS,
    RecursiveMethod,
    extended_kalman_filter,
    orders_of,
    pseudo_linear_regression,
    recursive_armax,
    recursive_arx,
    recursive_box_jenkins,
    recursive_estimator,
    recursive_output_error,
    recursive_prediction_error,
)

__all__ = [
    "RECURSIVE_METHODS",
    "Coefficient",
    "CoefficientHistory",
    "ExtendedKalman",
    "LiveRecursion",
    "RecursiveMethod",
    "RecursivePolynomial",
    "extended_kalman_filter",
    "orders_of",
    "pseudo_linear_regression",
    "recursive_armax",
    "recursive_arx",
    "recursive_box_jenkins",
    "recursive_estimator",
    "recursive_output_error",
    "recursive_prediction_error",
    "track",
]
