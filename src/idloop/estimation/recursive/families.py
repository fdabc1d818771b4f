"""The named recursive estimators: each is a structure and a method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from idloop.estimation.recursive.estimator import Method, RecursivePolynomial, structure
from idloop.estimation.recursive.extended_kalman import ExtendedKalman


def recursive_arx(na: int, nb: int | Sequence[int], nk: int | Sequence[int] = 1, **options: Any) -> RecursivePolynomial:
    """Recursive least squares, with forgetting or as a Kalman filter (Ljung, 2nd ed., section 11.2).

    Parameters
    ----------
    na : int
        Degree of A.
    nb, nk : int or one per input
        Number of coefficients of B and lag of the first [samples].
    **options
        Of `RecursivePolynomial`: forgetting, random_walk, start, prior, scales, names.

    Returns
    -------
    RecursivePolynomial
    """
    return RecursivePolynomial(structure(na=na, nb=nb, nk=nk), **options)


def extended_kalman_filter(
    na: int, nb: int | Sequence[int], nk: int | Sequence[int] = 1, **options: Any
) -> ExtendedKalman:
    """Extended Kalman filter of the state and the coefficients of A y = B u (Ljung 1979).

    Parameters
    ----------
    na : int
        Degree of A.
    nb, nk : int or one per input
        Number of coefficients of B and lag of the first [samples].
    **options
        Of `ExtendedKalman`: process_noise, measurement_noise, random_walk, drift, forgetting, start.

    Returns
    -------
    ExtendedKalman
    """
    return ExtendedKalman(structure(na=na, nb=nb, nk=nk), **options)


def recursive_armax(
    na: int,
    nb: int | Sequence[int],
    nc: int,
    nk: int | Sequence[int] = 1,
    *,
    method: Method = "gradient",
    **options: Any,
) -> RecursivePolynomial:
    """Recursive ARMAX: prediction error, or extended least squares with method "pseudo-linear".

    Parameters
    ----------
    na, nc : int
        Degrees of A and C.
    nb, nk : int or one per input
        Number of coefficients of B and lag of the first [samples].
    method : "gradient" or "pseudo-linear"
    **options
        Of `RecursivePolynomial`.

    Returns
    -------
    RecursivePolynomial
    """
    return RecursivePolynomial(structure(na=na, nb=nb, nc=nc, nk=nk), method=method, **options)


def recursive_output_error(
    nb: int | Sequence[int], nf: int | Sequence[int], nk: int | Sequence[int] = 1, **options: Any
) -> RecursivePolynomial:
    """Recursive output-error model y = B / F u + e.

    Parameters
    ----------
    nb, nf, nk : int or one per input
        Number of coefficients of B, degree of F, lag of the first coefficient of B [samples].
    **options
        Of `RecursivePolynomial`.

    Returns
    -------
    RecursivePolynomial
    """
    return RecursivePolynomial(structure(nb=nb, nf=nf, nk=nk), **options)


def recursive_box_jenkins(
    nb: int | Sequence[int], nc: int, nd: int, nf: int | Sequence[int], nk: int | Sequence[int] = 1, **options: Any
) -> RecursivePolynomial:
    """Recursive Box-Jenkins model y = B / F u + C / D e.

    Parameters
    ----------
    nb, nf, nk : int or one per input
        Number of coefficients of B, degree of F, lag of the first coefficient of B [samples].
    nc, nd : int
        Degrees of C and D.
    **options
        Of `RecursivePolynomial`.

    Returns
    -------
    RecursivePolynomial
    """
    return RecursivePolynomial(structure(nb=nb, nc=nc, nd=nd, nf=nf, nk=nk), **options)


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

    Returns
    -------
    RecursivePolynomial
    """
    return RecursivePolynomial(structure(na, nb, nc, nd, nf, nk), method="gradient", **options)


def pseudo_linear_regression(
    *, na: int = 0, nb: int | Sequence[int] = 0, nc: int = 0, nd: int = 0, nf: int | Sequence[int] = 0,
    nk: int | Sequence[int] = 1, **options: Any,
) -> RecursivePolynomial:  # fmt: skip
    """Recursive pseudo-linear regression for the general structure (Ljung, 2nd ed., section 11.5).

    Parameters
    ----------
    na, nc, nd : int
        Degrees of A, C and D.
    nb, nf, nk : int or one per input
        Number of coefficients of B, degree of F, lag of the first coefficient of B [samples].
    **options
        Of `RecursivePolynomial`.

    Returns
    -------
    RecursivePolynomial
    """
    return RecursivePolynomial(structure(na, nb, nc, nd, nf, nk), method="pseudo-linear", **options)
