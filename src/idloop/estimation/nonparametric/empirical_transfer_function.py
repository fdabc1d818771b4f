"""Empirical transfer function estimate: the output's spectrum over the input's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.nonparametric.frequency_response import FrequencyResponse
from idloop.estimation.nonparametric.spectra import CrossSpectra, Trend, response_from, without_trend

Complex = NDArray[np.complex128]


def etfe(
    data: SampledData | Sequence[SampledData], smoothing: float | None = None, *, trend: Trend = "constant"
) -> FrequencyResponse:
    """Ratio of the discrete Fourier transforms of output and input (Ljung, 2nd ed., sections 6.3 and 6.4).

    Without smoothing the estimate has a line for each line of the record and a variance that does not fall with
    its length. Smoothing averages neighbouring lines, each weighed by the power of its input (eq. 6.46); several
    experiments are averaged in the same way.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        Experiments; a shorter one is filled with zeros to the length of the longest.
    smoothing : float, optional
        Width of the Hann window over the frequencies at half its height [Hz].
    trend : {"constant", "linear", "none"}
        What is taken off each signal before.

    Returns
    -------
    FrequencyResponse
        Standard errors, coherence and disturbance only where there is something to average over.

    Raises
    ------
    InputError
        An input that stands still, inputs that move together, or a window that does not suit the record.
    """
    several = together(data)
    first = several[0]
    m = first.input.shape[1]
    length = max(len(one) for one in several)
    lines = length // 2 if length % 2 else length // 2 - 1
    if smoothing is None:
        if len(several) < m:
            raise InputError(
                f"{first.name}: {m} inputs from {len(several)} experiment; give as many experiments as inputs, or"
                " smooth over frequencies"
            )
        half, centres = 0, np.arange(1, lines + 1)
    else:
        spacing = 1.0 / (length * first.sample_time)
        # A Hann window of 2 h + 1 lines is h + 1 lines wide at half its height.
        half = round(smoothing / spacing) - 1
        if not 1 <= half <= lines // 2:
            raise InputError(
                f"{first.name}: smoothing over {smoothing:g} Hz; take between {2 * spacing:g} Hz (two lines) and"
                f" {spacing * (lines // 2):g} Hz"
            )
        # Half a width apart the averages overlap enough to lose nothing.
        centres = np.arange(max(half // 2, 1), lines + 1, max(half // 2, 1))
    weight = np.hanning(2 * half + 3)[1:-1]
    weight /= np.sum(weight)
    reach = centres[:, None] + np.arange(-half, half + 1)
    signals = first.output.shape[1] + m
    matrix = np.zeros((len(centres), signals, signals), dtype=complex)
    for one in several:
        values = without_trend(np.hstack([one.output, one.input]), trend)
        # The whole circle, so that a window that reaches below zero finds the mirror image.
        transform = np.fft.fft(values, length, axis=0).T
        matrix += _smoothed(transform, reach % length, weight)
    total = sum(len(one) for one in several)
    matrix *= 2.0 * first.sample_time / total
    spectra = CrossSpectra(
        centres / (length * first.sample_time),
        matrix,
        float(total / length / np.sum(weight**2)),
        total,
        None if smoothing is None else (half + 1) / (length * first.sample_time),
    )
    return response_from(spectra, several, "etfe" if smoothing is None else "smoothed etfe")


def _smoothed(transform: Complex, reach: NDArray[np.int64], weight: NDArray[np.float64]) -> Complex:
    """Weighted sums of the products of each pair of transforms, shape (f, c, c)."""
    signals = len(transform)
    matrix = np.empty((len(reach), signals, signals), dtype=complex)
    for i in range(signals):
        for j in range(i + 1):
            matrix[:, i, j] = (transform[i] * np.conj(transform[j]))[reach] @ weight
            matrix[:, j, i] = np.conj(matrix[:, i, j])
    return matrix
