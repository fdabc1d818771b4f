"""Ridge regression whose strength the data choose: for long models under narrow-band excitation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STRENGTHS = np.geomspace(1e-12, 1e1, 131)  # in deviations of the regressors


def evidence_regression(target: Array, regressors: Array, windows: int, floor: float) -> Array:
    """Coefficients of the ridge regression of greatest evidence, shape (t, r).

    Where the excitation leaves directions of the past nearly empty, least squares fills them with numbers that
    cancel in the data but not in a shifted window. A prior of zero mean on all coefficients keeps them small; its
    width maximises the marginal likelihood (MacKay, Neural Computation 4, 1992), so that it gives way to the data
    as these grow.

    `target`, `regressors` (t, columns), (r, columns): square roots of the second moments: rows of an LQ factor divided
    by the root of the number of windows; `windows`: observations behind the columns; `floor`: deviation of an error
    that counts as none.
    """
    left, values, basis = np.linalg.svd(regressors, full_matrices=False)
    explained = target @ basis.T
    rest = target - explained @ basis
    covariance = rest @ rest.T + floor**2 * np.eye(len(target))
    seen = np.linalg.solve(np.linalg.cholesky(covariance), explained)
    weight = np.sum(seen**2, axis=0)
    best, chosen = np.inf, _STRENGTHS[0]
    for strength in _STRENGTHS:
        # Minus twice the log of the evidence, without what all strengths share.
        spread = values**2 / strength**2
        criterion = len(target) * np.sum(np.log1p(spread)) + windows * np.sum(weight / (1.0 + spread))
        if criterion < best:
            best, chosen = criterion, strength
    return np.asarray((explained * (values / (values**2 + chosen**2))) @ left.T)
