"""Welch's averaged periodograms: response, coherence and variance from overlapping segments."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.nonparametric.frequency_response import FrequencyResponse
from idloop.estimation.nonparametric.spectra import CrossSpectra, response_from

Array = NDArray[np.float64]

_AT_ONCE = 1 << 20  # samples transformed at a time, so that memory does not grow with the record
_LONG = 1 << 16  # samples from which on resolution and averages grow alike
HANN_WIDTH = 1.44  # lines: width of a Hann window's power at half its height


def welch(
    data: SampledData | Sequence[SampledData], segment: int | None = None, *, overlap: float = 0.5
) -> FrequencyResponse:
    """Frequency response from averaged periodograms of Hann-windowed segments (Welch 1967; H1 estimate).

    Parameters
    ----------
    data : SampledData or sequence of SampledData
    segment : int, optional
        Length of a segment [samples]; by default an eighth of the data, of records above 65,536 samples as much
        more as the root of their length, at most the shortest experiment.
    overlap : float
        Share of a segment that the next one repeats.

    Returns
    -------
    FrequencyResponse
        With coherence, standard errors and the spectrum of the disturbance.

    Raises
    ------
    InputError
        Segments that the data does not hold, or inputs that tell nothing.
    """
    several = together(data)
    length = segment_length(several, segment, overlap)
    signals = [np.hstack([one.output, one.input]) for one in several]
    return response_from(averaged(signals, length, overlap, several[0].sample_time), several, "welch")


def segment_length(data: Sequence[SampledData], segment: int | None, overlap: float) -> int:
    """Length of the segments after checks; unless it is given, so that a longer record tells more of every line.

    Raises InputError: too long for the data, too short for a spectrum, or an overlap out of range.
    """
    shortest = min(len(one) for one in data)
    if segment is None:
        segment = usual_segment(data)
    if not 8 <= segment <= shortest:
        raise InputError(f"{data[0].name}: segments of {segment} samples; take between 8 and {shortest}")
    if not 0 <= overlap <= 0.9:
        raise InputError(f"overlap of {overlap:g}; take a share between 0 and 0.9")
    return int(segment)


def usual_segment(data: Sequence[SampledData]) -> int:
    """Length of the segments that a longer record makes longer, and also more [samples]."""
    samples = sum(len(one) for one in data)
    fine = samples if samples <= _LONG else math.isqrt(samples * _LONG)
    return min(max(fine // 8, 16), *(len(one) for one in data))


def averaged(signals: Sequence[Array], length: int, overlap: float, sample_time: float) -> CrossSpectra:
    """Average the periodograms of the segments of all experiments.

    `signals` (n, c): one for each experiment; `length`: of a segment [samples]; `overlap`: share of a segment;
    `sample_time`: [s]. Returns: at the segments' lines above zero and below half the sample rate. The number of
    averages allows for what overlapping segments have in common (Welch 1967, section III).
    """
    # Periodic, so that its lines are the segment's own.
    window = 0.5 * (1.0 - np.cos(2 * np.pi * np.arange(length) / length))
    hop = max(length - round(overlap * length), 1)
    last = (length - 1) // 2
    width = signals[0].shape[1]
    matrix = np.zeros((last, width, width), dtype=complex)
    counts = []
    for values in signals:
        starts = np.arange(0, len(values) - length + 1, hop)
        counts.append(len(starts))
        stretch = np.lib.stride_tricks.sliding_window_view(values, length, axis=0)
        for group in np.array_split(starts, max(1, -(-len(starts) * length * width // _AT_ONCE))):
            pieces = stretch[group]
            pieces = (pieces - np.mean(pieces, axis=-1, keepdims=True)) * window
            lines = np.fft.rfft(pieces, axis=-1)[:, :, 1 : last + 1].transpose(2, 1, 0)
            matrix += lines @ np.conj(lines.transpose(0, 2, 1))
    count = sum(counts)
    matrix *= 2.0 * sample_time / (float(np.sum(window**2)) * count)
    pairs = 0.0
    for lag in range(1, -(-length // hop)):
        common = np.sum(window[lag * hop :] * window[: length - lag * hop]) / np.sum(window**2)
        pairs += float(common**2) * sum(max(n - lag, 0) for n in counts)
    averages = count / (1.0 + 2.0 * pairs / count)
    return CrossSpectra(
        np.arange(1, last + 1) / (length * sample_time), matrix, averages, sum(len(values) for values in signals),
        HANN_WIDTH / (length * sample_time),
    )  # fmt: skip
