"""Blackman-Tukey spectral analysis: the response from windowed covariance functions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from idloop.errors import InputError
from idloop.estimate.nonparametric.frequency_response import FrequencyResponse
from idloop.estimate.nonparametric.spectra import CrossSpectra, Trend, response_from, without_trend
from idloop.estimate.sampled import SampledData, together

Array = NDArray[np.float64]


def spa(
    data: SampledData | Sequence[SampledData],
    window: int | None = None,
    frequency: ArrayLike | None = None,
    *,
    trend: Trend = "constant",
) -> FrequencyResponse:
    """Spectral analysis with a Hann lag window (Ljung, 2nd ed., section 6.4, eq. 6.55 to 6.74).

    Parameters
    ----------
    data : SampledData or sequence of SampledData
    window : int, optional
        Largest lag of the covariances [samples]: longer resolves finer and is noisier. A tenth of the data and at
        most 30 by default, as in the System Identification Toolbox.
    frequency : array_like, optional
        Where to look [Hz], above zero and below half the sample rate; 128 even steps by default.
    trend : {"constant", "linear", "none"}
        What is taken off each signal before.

    Returns
    -------
    FrequencyResponse
        With standard errors, coherence and the spectrum of the disturbance.

    Raises
    ------
    InputError
        A window longer than the data, frequencies out of range, or inputs that tell nothing.
    """
    several = together(data)
    first = several[0]
    total = sum(len(one) for one in several)
    shortest = min(len(one) for one in several)
    lags = max(min(total // 10, 30), 2) if window is None else int(window)
    if not 2 <= lags < shortest:
        raise InputError(f"{first.name}: lag window of {lags} samples; take between 2 and {shortest - 1}")
    half_rate = 0.5 / first.sample_time
    where = (
        half_rate * np.arange(1, 128) / 128 if frequency is None else np.sort(np.ravel(np.asarray(frequency, float)))
    )
    if where.size == 0 or not (where[0] > 0 and where[-1] < half_rate):
        raise InputError(f"{first.name}: frequencies must lie above 0 and below half the sample rate, {half_rate:g} Hz")
    signals = [without_trend(np.hstack([one.output, one.input]), trend) for one in several]
    covariance = np.sum([covariances(values, lags) for values in signals], axis=0) / total
    lag = np.arange(-lags, lags + 1)
    shape = 0.5 * (1.0 + np.cos(np.pi * lag / lags))
    kernel = np.exp(-2j * np.pi * first.sample_time * np.outer(where, lag)) * shape
    matrix = np.asarray(2.0 * first.sample_time * np.tensordot(kernel, covariance, axes=1), dtype=complex)
    spectra = CrossSpectra(where, matrix, total / float(np.sum(shape**2)), total)
    return response_from(spectra, several, "spa")


def covariances(values: Array, lags: int) -> Array:
    """Sums of products Σ_t z_i(t + τ) z_j(t) for τ = −lags..lags, by fast convolution.

    Parameters
    ----------
    values : ndarray, shape (n, c)
    lags : int

    Returns
    -------
    ndarray, shape (2 lags + 1, c, c)
    """
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(len(values) + lags, real=True)
    # Signals of very different size would leave their rounding in each other's products.
    scale = np.max(np.abs(values), axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    transform = rfft(values / scale, size, axis=0)
    signals = values.shape[1]
    result = np.empty((2 * lags + 1, signals, signals))
    for i in range(signals):
        for j in range(signals):
            circle = irfft(transform[:, i] * np.conj(transform[:, j]), size) * (scale[i] * scale[j])
            result[:, i, j] = np.concatenate([circle[size - lags :], circle[: lags + 1]])
    return result
