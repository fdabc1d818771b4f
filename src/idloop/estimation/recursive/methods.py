"""The recursive methods by name: which polynomials each has, and how it weighs the past."""

from __future__ import annotations

from typing import Any, NamedTuple

from idloop.errors import InputError
from idloop.estimation.polynomial.orders import Orders
from idloop.estimation.recursive.estimator import RecursivePolynomial, structure
from idloop.estimation.recursive.extended_kalman import ExtendedKalman
from idloop.spelling import did_you_mean_or_known

# Wander of a coefficient from sample to sample that the Kalman filter assumes, signals being of size 1.
DRIFT = 1e-3


class RecursiveMethod(NamedTuple):
    """A structure and a method.

    Attributes
    ----------
    degrees : dict of str to int
        Polynomials whose degree goes with the order: 1 has the order as degree, 0 none unless asked for.
    options : dict
        Of the estimator.
    estimator : type
        `RecursivePolynomial`, or one that goes on from it.
    """

    degrees: dict[str, int]
    options: dict[str, Any]
    estimator: type[RecursivePolynomial] = RecursivePolynomial


_ANY = {"na": 1, "nb": 1, "nc": 1, "nd": 0, "nf": 0}

RECURSIVE_METHODS: dict[str, RecursiveMethod] = {
    "rarx": RecursiveMethod({"na": 1, "nb": 1}, {}),
    "kalman": RecursiveMethod({"na": 1, "nb": 1}, {"drift": DRIFT}),
    "ekf": RecursiveMethod({"na": 1, "nb": 1}, {}, ExtendedKalman),
    "rarmax": RecursiveMethod({"na": 1, "nb": 1, "nc": 1}, {}),
    "roe": RecursiveMethod({"nb": 1, "nf": 1}, {}),
    "rbj": RecursiveMethod({"nb": 1, "nc": 1, "nd": 1, "nf": 1}, {}),
    "rpem": RecursiveMethod(_ANY, {}),
    "rplr": RecursiveMethod(_ANY, {"method": "pseudo-linear"}),
}


def recursive_estimator(name: str, orders: Orders, **options: Any) -> RecursivePolynomial:
    """Estimator of a method for given orders.

    Parameters
    ----------
    name : str
        A key of `RECURSIVE_METHODS`.
    orders : Orders
    **options
        Of the method's estimator; they come before the method's own.

    Returns
    -------
    RecursivePolynomial

    Raises
    ------
    InputError
        There is no such method, or as `RecursivePolynomial`.
    """
    method = _find(name)
    return method.estimator(orders, **{**method.options, **options})


def orders_of(name: str, order: int, delay: int, inputs: int = 1) -> Orders:
    """Orders of a method when all its polynomials have the same degree.

    Parameters
    ----------
    name : str
        A key of `RECURSIVE_METHODS`.
    order, delay : int
        Degree, and lag of the first effect of a command [samples].
    inputs : int

    Returns
    -------
    Orders

    Raises
    ------
    InputError
        There is no such method, or numbers out of range.
    """
    degrees = {polynomial: order * times for polynomial, times in _find(name).degrees.items()}
    return structure(**degrees, nk=(delay,) * inputs)


def _find(name: str) -> RecursiveMethod:
    if name not in RECURSIVE_METHODS:
        raise InputError(f"no recursive method {name!r}{did_you_mean_or_known(name, list(RECURSIVE_METHODS))}")
    return RECURSIVE_METHODS[name]
