"""Polynomial models: ARX, instrumental variables, ARMAX, output error, Box-Jenkins, and their orders."""

from __future__ import annotations

from idloop.estimation.polynomial.arx import arx
from idloop.estimation.polynomial.instruments import iv4
from idloop.estimation.polynomial.model import PolynomialModel
from idloop.estimation.polynomial.order_selection import (
    ArxStructures,
    DelayEstimate,
    arx_structures,
    estimate_delay,
    select_order,
)
from idloop.estimation.polynomial.polynomials import Orders, Polynomials
from idloop.estimation.polynomial.prediction_error import armax, box_jenkins, output_error

__all__ = [
    "ArxStructures",
    "DelayEstimate",
    "Orders",
    "PolynomialModel",
    "Polynomials",
    "armax",
    "arx",
    "arx_structures",
    "box_jenkins",
    "estimate_delay",
    "iv4",
    "output_error",
    "select_order",
]
