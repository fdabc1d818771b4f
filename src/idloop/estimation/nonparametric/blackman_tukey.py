"""Blackman-Tukey spectral analysis: the response from windowed covariance functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.nonparametric.frequency_response import FrequencyResponse
from idloop.estimation.nonparametric.spectra import CrossSpectra, Trend, response_from, without_trend
from idloop.estimation.nonparametric.welch import HANN_WIDTH, usual_segment

Array = NDArray[np.float64]

_STEPS = 128  # lines that are looked at, at least
_LEAST_AVERAGES = 4  # of a window for it to tell what a shorter one smooths away
_SIGMAS = 3.0
_STEEP = 1e-2  # power of an output's differences beside its own: less, and low frequencies leak into all others
_WORTH = 0.1  # a change of a response by less than this is not worth a word


def spa(
    data: SampledData | Sequence[SampledData],
    window: int | None = None,
    frequency: ArrayLike | None = None,
    *,
    trend: Trend = "constant",
) -> FrequencyResponse:
    """Spectral analysis with a Hann lag window (Ljung, 2nd ed., section 6.4, eq. 6.55 to 6.74).

    Where an output has nearly all of its power at low frequencies, as the position of an axis that turns on has, all
    signals are differenced down to the resolution first and the spectra are divided by what that does: the response
    stays what it is, and what leaks from there does not cover it (prewhitening: Jenkins and Watts, Spectral Analysis,
    section 7.3).

    Parameters
    ----------
    data : SampledData or sequence of SampledData
    window : int, optional
        Largest lag of the covariances [samples]: longer resolves finer, 1 / (window x sample time), and is noisier.
        By default that of the resolution that `welch` takes, which grows with the record: the 30 samples of the System
        Identification Toolbox smooth the resonances of a drive away at its usual sample rates.
    frequency : array_like, optional
        Where to look [Hz], above zero and below half the sample rate; at least 128 even steps by default, half the
        resolution apart or closer.
    trend : {"constant", "linear", "none"}
        What is taken off each signal before.

    Returns
    -------
    FrequencyResponse
        With standard errors, coherence and the spectrum of the disturbance, and a note where twice the window shows
        that this one smooths too much: the standard errors are those of noise alone.

    Raises
    ------
    InputError
        A window longer than the data, frequencies out of range, or inputs that tell nothing.
    """
    several = together(data)
    first = several[0]
    total = sum(len(one) for one in several)
    shortest = min(len(one) for one in several)
    lags = min(max(round(usual_segment(several) / HANN_WIDTH), 2), shortest - 1) if window is None else int(window)
    if not 2 <= lags < shortest:
        raise InputError(f"{first.name}: lag window of {lags} samples; take between 2 and {shortest - 1}")
    half_rate = 0.5 / first.sample_time
    steps = max(_STEPS, lags)
    where = half_rate * np.arange(1, steps) / steps if frequency is None else np.ravel(np.asarray(frequency, float))
    where = np.sort(where)
    if where.size == 0 or not (where[0] > 0 and where[-1] < half_rate):
        raise InputError(f"{first.name}: frequencies must lie above 0 and below half the sample rate, {half_rate:g} Hz")
    signals = [without_trend(np.hstack([one.output, one.input]), trend) for one in several]
    # Below the resolution the filter is flat: it does not take the little that there is to see there.
    share = np.exp(-2.0 * np.pi / lags) if _steep(signals, first.output.shape[1]) else 0.0
    if share:
        signals = [values[1:] - share * values[:-1] for values in signals]
    twice = 2 * lags
    longest = twice if twice < shortest and total >= _LEAST_AVERAGES * twice else lags
    covariance = np.sum([covariances(values, longest) for values in signals], axis=0) / total
    even = steps if frequency is None else None
    period = first.sample_time
    recolour = np.abs(1.0 - share * np.exp(-2j * np.pi * where * period)) ** 2

    def estimate(lags: int) -> FrequencyResponse:
        spectra = _spectra(covariance, lags, where, even, period, total)
        return response_from(replace(spectra, matrix=spectra.matrix / recolour[:, None, None]), several, "spa")

    found = estimate(lags)
    if longest == lags:
        return found
    return replace(found, notes=(*found.notes, *_smoothing_notes(found, estimate(twice), twice)))


def _steep(signals: Sequence[Array], outputs: int) -> bool:
    """Whether one output hardly changes from sample to sample beside its whole motion."""
    power = np.sum([np.sum((values - np.mean(values, axis=0)) ** 2, axis=0) for values in signals], axis=0)
    change = np.sum([np.sum(np.diff(values, axis=0) ** 2, axis=0) for values in signals], axis=0)
    return bool(np.any(change[:outputs] < _STEEP * power[:outputs]))


def _spectra(
    covariance: Array, lags: int, where: Array, even: int | None, sample_time: float, samples: int
) -> CrossSpectra:
    """Spectra by a window of so many lags; `even` steps up to half the sample rate take one fast transform."""
    middle = len(covariance) // 2
    lag = np.arange(-lags, lags + 1)
    shape = 0.5 * (1.0 + np.cos(np.pi * lag / lags))
    windowed = covariance[middle - lags : middle + lags + 1] * shape[:, None, None]
    if even is None:
        matrix = np.tensordot(np.exp(-2j * np.pi * sample_time * np.outer(where, lag)), windowed, axes=1)
    else:
        # Lags that lie a whole turn apart have the same phase at every step.
        wrapped = np.zeros((2 * even, *covariance.shape[1:]))
        np.add.at(wrapped, lag % (2 * even), windowed)
        matrix = np.fft.fft(wrapped, axis=0)[1:even]
    averages = samples / float(np.sum(shape**2))
    return CrossSpectra(
        where, np.asarray(2.0 * sample_time * matrix, dtype=complex), averages, samples, 1.0 / (lags * sample_time)
    )


def _smoothing_notes(found: FrequencyResponse, finer: FrequencyResponse, window: int) -> tuple[str, ...]:
    """One note for each output that a longer window changes by more than noise can."""
    if not np.array_equal(found.frequency, finer.frequency):
        return ()
    notes = []
    for column, name in enumerate(found.output_names):
        change = np.max(np.abs(found.response - finer.response)[:, column], axis=1)
        size = np.max(np.abs(finer.response[:, column]), axis=1)
        # The estimates share their data: what sets them apart is less than the noise of the finer one.
        sure = (change > _SIGMAS * np.max(finer.stderr[:, column], axis=1)) & (change > _WORTH * size)
        if np.any(sure):
            at = int(np.argmax(np.where(sure, change / np.maximum(size, 1e-300), 0.0)))
            notes.append(
                f"{name}: smoothed too much, near {found.frequency[at]:.3g} Hz by {100 * change[at] / size[at]:.0f} %,"
                f" which the bands do not hold; look with a window of {window} samples"
            )
    return tuple(notes)


def covariances(values: Array, lags: int) -> Array:
    """Sums of products Σ_t z_i(t + τ) z_j(t) for τ = −lags..lags, by fast convolution, shape (2 lags + 1, c, c).

    `values` (n, c).
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
