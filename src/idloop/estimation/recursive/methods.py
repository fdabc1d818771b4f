"""The recursive methods by name: which polynomials each has, and how it weighs the past."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from idloop.errors import InputError
from idloop.estimation.polynomial.polynomials import Orders
from idloop.estimation.recursive.estimator import RecursivePolynomial
from idloop.estimation.recursive.extended_kalman import ExtendedKalman
from idloop.spelling import did_you_mean_or_known

# Standard deviation of the random walk that the Kalman filter assumes, for signals of size 1.
DRIFT = 1e-3


def recursive_arx(na: int, nb: int | Sequence[int], nk: int | Sequence[int] = 1, **options: Any) -> RecursivePolynomial:
    """Recursive least squares, with forgetting or as a Kalman filter (Ljung, 2nd ed., section 11.2).

    Orders as for `idloop.estimation.polynomial.arx`; options of `RecursivePolynomial`.
    """
    return RecursivePolynomial(Orders.of(na=na, nb=nb, nk=nk), **options)


def extended_kalman_filter(
    na: int, nb: int | Sequence[int], nk: int | Sequence[int] = 1, **options: Any
) -> ExtendedKalman:
    """Extended Kalman filter of the state and the coefficients of A y = B u (Ljung 1979).

    Orders as for `recursive_arx`; options of `ExtendedKalman`.
    """
    return ExtendedKalman(Orders.of(na=na, nb=nb, nk=nk), **options)


def recursive_armax(
    na: int, nb: int | Sequence[int], nc: int, nk: int | Sequence[int] = 1, **options: Any
) -> RecursivePolynomial:
    """Recursive ARMAX: prediction error, or extended least squares with the option ``method="pseudo-linear"``.

    Parameters as for `recursive_prediction_error`.
    """
    return RecursivePolynomial(Orders.of(na=na, nb=nb, nc=nc, nk=nk), **options)


def recursive_output_error(
    nb: int | Sequence[int], nf: int | Sequence[int], nk: int | Sequence[int] = 1, **options: Any
) -> RecursivePolynomial:
    """Recursive output-error model y = B / F u + e; parameters as for `recursive_prediction_error`."""
    return RecursivePolynomial(Orders.of(nb=nb, nf=nf, nk=nk), **options)


def recursive_box_jenkins(
    nb: int | Sequence[int], nc: int, nd: int, nf: int | Sequence[int], nk: int | Sequence[int] = 1, **options: Any
) -> RecursivePolynomial:
    """Recursive Box-Jenkins model y = B / F u + C / D e; parameters as for `recursive_prediction_error`."""
    return RecursivePolynomial(Orders.of(nb=nb, nc=nc, nd=nd, nf=nf, nk=nk), **options)


def recursive_prediction_error(
    *, na: int = 0, nb: int | Sequence[int] = 0, nc: int = 0, nd: int = 0, nf: int | Sequence[int] = 0,
    nk: int | Sequence[int] = 1, **options: Any,
) -> RecursivePolynomial:  # fmt: skip
    """Recursive prediction error method for the general structure (Ljung, 2nd ed., section 11.4).

    Parameters
    ----------
    na, nc, nd : int
        Degrees of A, C and D.
    nb, nf, nk : int or one per input
        Number of coefficients of B, degree of F, lag of the first coefficient of B [samples].
    **options
        Of `RecursivePolynomial`.
    """
    return RecursivePolynomial(Orders.of(na=na, nb=nb, nc=nc, nd=nd, nf=nf, nk=nk), **options)


def pseudo_linear_regression(**numbers: Any) -> RecursivePolynomial:
    """Recursive pseudo-linear regression (Ljung, section 11.5); parameters as for `recursive_prediction_error`."""
    return recursive_prediction_error(method="pseudo-linear", **numbers)


class RecursiveMethod(NamedTuple):
    """A structure and a method."""

    # Polynomials whose degree goes with the order: 1 has the order as degree, 0 none unless asked for
    degrees: dict[str, int]
    options: dict[str, Any]  # of the estimator
    estimator: type[RecursivePolynomial] = RecursivePolynomial  # `RecursivePolynomial`, or a subclass


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
    **options
        Of the method's estimator; they come before the method's own.

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

    Raises
    ------
    InputError
        There is no such method, or numbers out of range.
    """
    degrees = {polynomial: order * times for polynomial, times in _find(name).degrees.items()}
    return Orders.of(**degrees, nk=(delay,) * inputs)


def _find(name: str) -> RecursiveMethod:
    if name not in RECURSIVE_METHODS:
        raise InputError(f"no recursive method {name!r}{did_you_mean_or_known(name, list(RECURSIVE_METHODS))}")
    return RECURSIVE_METHODS[name]
