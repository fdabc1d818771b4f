"""Recursive estimation of polynomial models, sample by sample: for records and for nodes."""

from __future__ import annotations

from idloop.estimate.recursion.estimator import RecursivePolynomial
from idloop.estimate.recursion.extended_kalman import ExtendedKalman
from idloop.estimate.recursion.families import (
    extended_kalman_filter,
    pseudo_linear_regression,
    recursive_armax,
    recursive_arx,
    recursive_box_jenkins,
    recursive_output_error,
    recursive_prediction_error,
)
from idloop.estimate.recursion.history import CoefficientHistory, track
from idloop.estimate.recursion.live import Coefficient, LiveRecursion
from idloop.estimate.recursion.methods import RECURSIVE_METHODS, RecursiveMethod, orders_of, recursive_estimator

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
