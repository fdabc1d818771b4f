"""Covariance of the coefficients, by Ljung's asymptotics, for white and for coloured errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.statistics.covariance import long_run_covariance

Array = NDArray[np.float64]

_MOST_ROWS = 50_000  # of scores; longer records are summed in stretches first


def white_errors(factor: Array, variance: float, undetermined: NDArray[np.bool_]) -> Array:
    """Variance of the errors times the inverse of the information (Ljung, 2nd ed., eq. 9.42), shape (k, k).

    `factor` (k, r): W with W W^T the inverse of the sum of psi psi^T; `undetermined` (k,): coefficients that get NaN.
    """
    return _opened(variance * factor @ factor.T, undetermined)


def coloured_errors(factor: Array, scores: Sequence[Array], parameters: int, undetermined: NDArray[np.bool_]) -> Array:
    """Sandwich: holds when the errors are not white, as under a noise model that is too poor (eq. 9.11 to 9.17).

    `factor` (k, r): W with W W^T the inverse of the sum of psi psi^T; `scores` (n_i, r): psi(t)^T W e(t) of each
    experiment, or sums of them over `stretch` samples; `parameters`: numbers that were estimated, for the small-sample
    factor; `undetermined` (k,): coefficients that get NaN. Returns shape (k, k).
    """
    total = sum(len(part) for part in scores)
    stretch = max(1, total // _MOST_ROWS)
    # Sums over stretches have the same long-run covariance, at a fraction of the cost.
    summed = [np.add.reduceat(part, np.arange(0, len(part), stretch), axis=0) for part in scores]
    summed = [part for part in summed if len(part) > 3]
    if not summed or not factor.shape[1]:
        return _opened(np.full((factor.shape[0],) * 2, np.nan), undetermined)
    rows = sum(len(part) for part in summed)
    centre = long_run_covariance(summed) * rows * total / max(total - parameters, 1)
    return _opened(factor @ centre @ factor.T, undetermined)


def _opened(covariance: Array, undetermined: NDArray[np.bool_]) -> Array:
    covariance = 0.5 * (covariance + covariance.T)
    covariance[undetermined, :] = np.nan
    covariance[:, undetermined] = np.nan
    return covariance
