"""Long-run covariance of scores by vector autoregression: scores of resonances swing, which kernels take for noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[np.float64]


def autoregressive_covariance(series: Sequence[Array]) -> Array:
    """Covariance of the sum of a stationary series of mean zero, per sample, shape (k, k).

    A vector autoregression whose order minimises the Bayesian criterion is fitted; its spectral density at zero
    frequency is the answer (VARHAC; den Haan and Levin, Handbook of Statistics 15, 1997). The quadratic spectral
    kernel of `idloop.estimation.statistics.covariance` suits scores that die out without swinging.

    `series` (n_i, k): of each experiment.
    """
    k = series[0].shape[1]
    scale = np.sqrt(sum(np.sum(one**2, axis=0) for one in series) / sum(len(one) for one in series))
    scale[scale == 0.0] = 1.0
    samples = sum(len(one) for one in series)
    longest = int(min(samples ** (1 / 3), samples / (10 * k)))
    longest = max(min(longest, min(len(one) for one in series) // 2 - 1), 0)
    windows = np.concatenate(
        [sliding_window_view(one / scale, longest + 1, axis=0).transpose(0, 2, 1) for one in series]
    )
    count = len(windows)
    # Newest lag first: shorter models are the first columns of longer ones.
    columns = windows[:, ::-1].reshape(count, -1)
    factor = np.asarray(np.linalg.qr(np.hstack([columns[:, k:], columns[:, :k]]), mode="r"))
    best, lags = np.inf, 0
    for order in range(longest + 1):
        rest = factor[k * order :, k * longest :]
        sign, size = np.linalg.slogdet(rest.T @ rest / count + 1e-12 * np.eye(k))
        criterion = count * size + np.log(count) * order * k * k
        if sign > 0 and criterion < best:
            best, lags = criterion, order
    coefficients = np.linalg.lstsq(factor[: k * lags, : k * lags], factor[: k * lags, k * longest :], rcond=None)[0]
    rest = factor[k * lags :, k * longest :]
    innovation = rest.T @ rest / count
    back = np.linalg.inv(np.eye(k) - coefficients.reshape(lags, k, k).sum(axis=0).T)
    covariance = back @ innovation @ back.T
    return np.asarray(covariance * np.outer(scale, scale))
