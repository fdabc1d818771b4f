"""B and D by least squares on all outputs, once A, C and the Kalman gain are known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.linear.sensitivity import Matrices, compressed_errors
from idloop.estimation.subspace.compression import Compression
from idloop.estimation.subspace.modal_regression import modal_regression

Array = NDArray[np.float64]


def command_matrices(
    compression: Compression, a: Array, c: Array, gain: Array, feedthrough: bool
) -> tuple[Array, Array, Array | None]:
    """B and D that make the predicted outputs closest to the measured ones, first states included.

    For given A, C and K the prediction is linear in B, D and the first state (Ljung, System Identification, 2nd ed.,
    eq. 10.127); with a zero gain it is the free run.

    `a`, `c`, `gain` (n, n), (p, n), (n, p): in scaled units; `feedthrough`: whether D is estimated; else it is zero.
    Returns `b, d` (n, m), (p, m); `covariance` (p, p): of the errors in scaled units, where they came out on the way.
    Raises IdloopError: the response overflows: an unstable model without a Kalman gain.
    """
    n, m, p = len(a), compression.inputs, compression.outputs
    if compression.squared:  # moments carry enough digits
        fit = modal_regression(a, c, gain, compression, feedthrough)
        if fit is not None:
            return fit.b, fit.d, fit.covariance
    base = Matrices(a, np.zeros((n, m)), c, np.zeros((p, m)), gain)
    count = n * m + (p * m if feedthrough else 0)
    everything = np.zeros((base.flat().size, count))
    everything[n * n : n * n + n * m, : n * m] = np.eye(n * m)
    at_d = n * n + n * m + p * n
    everything[at_d : at_d + p * m, n * m :] = np.eye(p * m, count - n * m)
    residual, jacobian = compressed_errors(base, base.like(everything), compression.scaled(), np.eye(p))
    if not np.all(np.isfinite(residual)):
        raise IdloopError("the model found is unstable and its free run overflows; add --stable, in Python stable=True")
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    solution = -np.linalg.lstsq(jacobian / scale, residual, rcond=1e-12)[0] / scale
    found = base.like(everything @ solution)
    return found.b, found.d, None
