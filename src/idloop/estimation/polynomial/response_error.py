"""Standard errors of a polynomial model's frequency response, from those of its coefficients."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.polynomial.polynomials import Polynomials

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def response_error(polynomials: Polynomials, index: int, frequency: Array) -> tuple[Complex, Array, Array]:
    """Response G = B / (A F) from one input, with the standard errors of its size and angle.

    To first order in the coefficients: dG is linear in them, d|G| / |G| the real part of dG / G and the angle its
    imaginary part (Ljung, System Identification, 2nd ed., section 9.4).

    Parameters
    ----------
    polynomials : Polynomials
    index : int
        Input.
    frequency : ndarray, shape (f,)
        [Hz]

    Returns
    -------
    response : ndarray of complex, shape (f,)
        [output unit / input unit]
    size_error : ndarray, shape (f,)
        Standard error of the magnitude [output unit / input unit]; NaN where no covariance is known.
    angle_error : ndarray, shape (f,)
        Standard error of the phase [rad].
    """
    orders = polynomials.orders
    delayed = np.exp(-2j * np.pi * np.asarray(frequency, dtype=float) * polynomials.sample_time)

    def powers(first: int, count: int) -> Complex:
        return np.asarray(delayed[:, None] ** np.arange(first, first + count))

    def value(coefficients: Array) -> Complex:
        return np.asarray(powers(0, len(coefficients)) @ coefficients)

    a, f = value(polynomials.a), value(polynomials.f[index])
    response = value(polynomials.numerator(index)) / (a * f)
    if polynomials.covariance is None:
        return response, np.full(response.shape, np.nan), np.full(response.shape, np.nan)
    slope = np.zeros((len(delayed), orders.size), dtype=complex)
    slope[:, orders.a] = -response[:, None] * powers(1, orders.na) / a[:, None]
    slope[:, orders.b(index)] = powers(orders.nk[index], orders.nb[index]) / (a * f)[:, None]
    slope[:, orders.f(index)] = -response[:, None] * powers(1, orders.nf[index]) / f[:, None]
    size = np.abs(response)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = slope / response[:, None]
    radial, turning = (
        np.sqrt(np.maximum(np.einsum("fi,ij,fj->f", part, polynomials.covariance, part), 0.0))
        for part in (relative.real, relative.imag)
    )
    return response, size * radial, turning
