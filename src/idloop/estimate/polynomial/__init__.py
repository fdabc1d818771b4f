"""Polynomial models: ARX, instrumental variables, ARMAX, output error, Box-Jenkins, and their orders."""

from __future__ import annotations

from idloop.estimate.polynomial.arx import arx
from idloop.estimate.polynomial.delay import DelayEstimate, estimate_delay
from idloop.estimate.polynomial.instruments import iv4
from idloop.estimate.polynomial.model import PolynomialModel
from idloop.estimate.polynomial.orders import Orders
from idloop.estimate.polynomial.polynomials import Polynomials
from idloop.estimate.polynomial.prediction_error import armax, box_jenkins, output_error, polynomial_model
from idloop.estimate.polynomial.structures import ArxStructures, arx_structures, select_order

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
    "polynomial_model",
    "select_order",
]
