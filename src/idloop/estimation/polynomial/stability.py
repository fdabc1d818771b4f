"""Roots of monic polynomials in the delay operator: how far out they lie, and how they are brought in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def radius(polynomial: Array) -> float:
    """Largest magnitude of the roots of 1 + p1 q^-1 + ... (0 for a constant, infinite if not finite)."""
    if len(polynomial) < 2:
        return 0.0
    if not np.all(np.isfinite(polynomial)):
        return float("inf")
    return float(np.max(np.abs(np.roots(polynomial)), initial=0.0))


def reflect(polynomial: Array, limit: float = 1.0) -> Array:
    """Mirror the roots outside the unit circle at it, and pull what is still beyond `limit` in to that.

    Mirroring keeps the magnitude of the frequency response up to a factor.

    `polynomial`: coefficients of 1, q^-1, ...; the first is 1; `limit`: largest magnitude that is left alone. Returns:
    as long as `polynomial`, first coefficient 1.
    """
    if radius(polynomial) <= limit:
        return polynomial
    roots = np.roots(polynomial)
    size = np.abs(roots)
    roots = np.where(size > max(limit, 1.0), roots / np.maximum(size, 1.0) ** 2, roots)
    size = np.abs(roots)
    roots = np.where(size > limit, roots * limit / np.maximum(size, limit), roots)
    result = np.zeros(len(polynomial))
    found = np.real(np.poly(roots))
    result[: len(found)] = found
    return result
