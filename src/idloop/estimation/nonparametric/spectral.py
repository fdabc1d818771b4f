"""Spectral analysis: frequency responses from averaged cross spectra of the signals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array, Complex, Integers, Mask
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.nonparametric.frequency_response import FrequencyResponse

Trend = Literal["constant", "linear", "none"]
_SILENT = 1e-12  # an input's power at a line below this share of its greatest is rounding, not excitation
_TOGETHER = 1e-8  # inputs whose coherence matrix is closer to singular than this are taken for dependent
_AT_ONCE = 1 << 20  # samples transformed at a time, so that memory does not grow with the record
_LONG = 1 << 16  # samples from which on resolution and averages grow alike
HANN_WIDTH = 1.44  # lines: width of a Hann window's power at half its height
_STEPS = 128  # fewest lines of an estimate
_LEAST_AVERAGES = 4  # fewest of the longer window that shows what the shorter one smooths away
_SIGMAS = 3.0
_STEEP = 1e-2  # power of an output's differences over its own, below which low frequencies leak into all others
_RELEVANT = 0.1  # relative change of a response that gets a note
_LEAST_COHERENCE = 4.0  # the reference's share of the command, in units of what chance alone would give it


@dataclass(frozen=True, eq=False)
class CrossSpectra:
    """Averaged spectra of several signals."""

    frequency: Array  # shape (f,): [Hz]
    matrix: Complex  # shape (f, c, c): one-sided cross power densities ``E[Z Zᴴ]`` [product of the signals' units / Hz]
    averages: float  # number of independent averages that the estimate is worth
    samples: int  # that it rests on
    # Width of what is averaged over, at half its height [Hz]; None where every line is its own
    resolution: float | None = None


def without_trend(values: Array, trend: Trend) -> Array:
    """Columns without their mean or their straight line, shape (n, c)."""
    if trend == "none":
        return values
    centred = values - np.mean(values, axis=0)
    if trend == "constant":
        return np.asarray(centred)
    if trend != "linear":
        raise InputError(f"trend {trend!r}; take 'constant', 'linear' or 'none'")
    ramp = np.linspace(-1.0, 1.0, len(values))
    return np.asarray(centred - np.outer(ramp, ramp @ centred / max(float(ramp @ ramp), 1e-300)))


def response_from(
    spectra: CrossSpectra, data: Sequence[SampledData], method: str, notes: tuple[str, ...] = ()
) -> FrequencyResponse:
    """Response of least squares at each line: G = S_yu S_uu⁻¹ (Bendat and Piersol, Random Data, chapter 7).

    The mean square of the complex error of an entry is the disturbance's density times the entry of S_uu⁻¹ over
    the number of averages, the disturbance's with the degrees of freedom that the response has used up.

    `spectra`: of outputs and inputs, in this order; `data`: where they come from. Raises InputError: an input that
    does not move, or inputs that move together.
    """
    first = data[0]
    p, m = first.output.shape[1], first.input.shape[1]
    matrix = spectra.matrix
    power = np.einsum("fii->fi", matrix).real
    excited = _excited(power[:, p:], first.input_names, first.name)
    matrix, power = matrix[excited], power[excited]
    size = np.sqrt(power[:, p:])
    inputs = matrix[:, p:, p:] / (size[:, :, None] * size[:, None, :])
    if m > 1 and np.min(np.linalg.eigvalsh(inputs)[:, 0]) < _TOGETHER:
        raise InputError(
            f"{first.name}: the inputs {', '.join(first.input_names)} move together, so their effects cannot be"
            " separated; excite them independently, or smooth over more lines"
        )
    inverse = np.linalg.inv(inputs) / (size[:, :, None] * size[:, None, :])
    response = matrix[:, :p, p:] @ inverse
    explained = np.einsum("fij,fji->fi", response, matrix[:, p:, :p]).real
    outputs = power[:, :p]
    share = np.where(outputs > 0, explained / np.where(outputs > 0, outputs, 1.0), 0.0)
    drowned = int(np.sum(np.any(outputs <= 0, axis=1)))
    if drowned:
        notes = (*notes, f"at {drowned} lines an output holds less than leaks in from others; lengthen the window")
    dropped = int(np.sum(~excited))
    if dropped:
        notes = (*notes, f"{dropped} of {excited.size} lines carry no input and are left out")
    spectra = replace(spectra, frequency=spectra.frequency[excited])
    diagonal = np.einsum("fii->fi", inverse).real
    found = _with_errors(method, spectra, response, outputs - explained, outputs, diagonal, notes, first)
    return found if found.disturbance is None else replace(found, coherence=np.clip(share, 0.0, 1.0))


def _excited(power: Array, names: Sequence[str], where: str) -> Mask:
    """Lines at which every signal that drives the plant has power, shape (f,)."""
    greatest = np.max(power, axis=0)
    for level, name in zip(greatest, names, strict=True):
        if not level > 0:
            raise InputError(f"{where}: {name} does not move; a response needs an input that moves")
    return np.asarray(np.all(power > _SILENT * greatest, axis=1))


def welch(
    data: SampledData | Sequence[SampledData], segment: int | None = None, *, overlap: float = 0.5
) -> FrequencyResponse:
    """Frequency response from averaged periodograms of Hann-windowed segments (Welch 1967; H1 estimate).

    `segment`: length of a segment [samples]; by default an eighth of the data, of records above 65,536 samples as much
    more as the root of their length, at most the shortest experiment; `overlap`: share of a segment that the next one
    repeats. Returns: with coherence, standard errors and the spectrum of the disturbance. Raises InputError: segments
    that the data does not hold, or inputs without power.
    """
    several = together(data)
    length = segment_length(several, segment, overlap)
    signals = [np.hstack([one.output, one.input]) for one in several]
    return response_from(averaged(signals, length, overlap, several[0].sample_time), several, "welch")


def segment_length(data: Sequence[SampledData], segment: int | None, overlap: float) -> int:
    """Length of the segments after checks; by default it grows with the record, and so does the number of averages."""
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
    """Average the periodograms of the segments of all experiments."""
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
        A window longer than the data, frequencies out of range, or inputs without power.
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
    # Below the resolution the filter is flat and does not attenuate what little power there is.
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
        # Both estimates use the same data: their difference has less noise than the finer one.
        sure = (change > _SIGMAS * np.max(finer.stderr[:, column], axis=1)) & (change > _RELEVANT * size)
        if np.any(sure):
            at = int(np.argmax(np.where(sure, change / np.maximum(size, 1e-300), 0.0)))
            notes.append(
                f"{name}: smoothed too much near {found.frequency[at]:.3g} Hz by {100 * change[at] / size[at]:.0f} %,"
                f" which the bands do not include; take a window of {window} samples"
            )
    return tuple(notes)


def covariances(values: Array, lags: int) -> Array:
    """Sums of products Σ_t z_i(t + τ) z_j(t) for τ = −lags..lags, shape (2 lags + 1, c, c)."""
    from scipy.signal import correlate

    count, signals = values.shape
    # Zeros behind a record shorter than the lags.
    padded = np.vstack([values, np.zeros((max(lags + 1 - count, 0), signals))])
    middle = slice(len(padded) - 1 - lags, len(padded) + lags)
    result = np.empty((2 * lags + 1, signals, signals))
    for i, j in np.ndindex(signals, signals):
        result[:, i, j] = correlate(padded[:, i], padded[:, j], method="fft")[middle]
    return result


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
        An input that does not move, inputs that move together, or a window that does not suit the record.
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


def _smoothed(transform: Complex, reach: Integers, weight: Array) -> Complex:
    """Weighted sums of the products of each pair of transforms, shape (f, c, c)."""
    signals = len(transform)
    matrix = np.empty((len(reach), signals, signals), dtype=complex)
    for i in range(signals):
        for j in range(i + 1):
            matrix[:, i, j] = (transform[i] * np.conj(transform[j]))[reach] @ weight
            matrix[:, j, i] = np.conj(matrix[:, i, j])
    return matrix


def indirect(
    data: SampledData | Sequence[SampledData], segment: int | None = None, *, overlap: float = 0.5
) -> FrequencyResponse:
    """Response S_yr / S_ur from the reference, without the bias that feedback puts into S_yu / S_uu.

    Under feedback the command answers to the disturbance, and S_yu / S_uu is biased towards the negative inverse of
    the controller. What output and command have in common with the reference does not (Wellstead 1981;
    Pintelon and Schoukens, 2nd ed., section 2.6.4). The error's mean square is that of the instrumental
    variable: S_ee S_rr / |S_ur|² over the number of averages, with e the part of the output that the estimate
    leaves over.

    `data`: one input, and the reference; `segment`, `overlap`: as for ``welch``. Returns: its coherence is that between
    reference and command, shape (f, 1) for all outputs: where it is low, the reference does not reach the plant. Raises
    InputError: no reference, a reference that does not move, or more than one input.
    """
    several = together(data)
    first = several[0]
    if first.input.shape[1] != 1:
        raise InputError(f"{first.name}: {first.input.shape[1]} inputs; one reference gives the response to one input")
    signals = []
    for one in several:
        if one.reference is None:
            raise InputError(f"{one.name}: no reference recorded; record it, or use welch if the loop was open")
        if not np.all(np.isfinite(one.reference)):
            raise InputError(f"{one.name}: reference holds NaN or infinite samples; cut them out first")
        signals.append(np.column_stack([one.output, one.input, one.reference]))
    spectra = averaged(signals, segment_length(several, segment, overlap), overlap, first.sample_time)
    p = first.output.shape[1]
    power = np.einsum("fii->fi", spectra.matrix).real
    moves = _excited(power[:, p:], (first.input_names[0], "reference"), first.name)
    matrix, power = spectra.matrix[moves], power[moves]
    outputs, command, reference = power[:, :p], power[:, p], power[:, p + 1]
    through = matrix[:, p, p + 1]
    coherence = np.abs(through) ** 2 / (reference * command)
    response = matrix[:, :p, p + 1] / through[:, None]
    left = outputs - 2 * np.real(np.conj(response) * matrix[:, :p, p]) + np.abs(response) ** 2 * command[:, None]
    weak = int(np.sum(coherence * spectra.averages < _LEAST_COHERENCE))
    notes = []
    if weak:
        notes.append(f"at {weak} of {coherence.size} lines the reference hardly reaches the command; ignore these")
    if np.any(~moves):
        notes.append(f"{int(np.sum(~moves))} of {moves.size} lines carry no reference and are left out")
    spectra = replace(spectra, frequency=spectra.frequency[moves])
    inverse = (reference / np.abs(through) ** 2)[:, None]
    found = _with_errors("indirect", spectra, response[:, :, None], left, outputs, inverse, tuple(notes), first)
    return replace(found, coherence=np.repeat(coherence[:, None], p, axis=1))


def _with_errors(
    method: str, spectra: CrossSpectra, response: Complex, left: Array, outputs: Array, inverse: Array,
    notes: tuple[str, ...], data: SampledData,
) -> FrequencyResponse:  # fmt: skip
    """Response with the disturbance that it leaves, and standard errors from that.

    `left`, `outputs` (f, p): power density of what the response leaves of each output, and of the output itself;
    `inverse` (f, m): diagonal of the inverse spectrum of the inputs.
    """
    # The residual power is never below the rounding of the output's power.
    left = np.maximum(left, 4 * np.finfo(float).eps * np.abs(outputs))
    spare = spectra.averages - response.shape[2]
    known = spare > 0.5
    disturbance = left * (spectra.averages / spare) if known else np.full_like(left, np.nan)
    variance = disturbance[:, :, None] * inverse[:, None, :] / spectra.averages
    return FrequencyResponse(
        method=method,
        frequency=spectra.frequency,
        response=response,
        stderr=np.sqrt(variance),
        degrees=np.full(len(response), 2.0 * spare if known else np.nan),
        disturbance=disturbance if known else None,
        disturbance_stderr=disturbance / np.sqrt(spare) if known else None,
        samples=spectra.samples,
        resolution=spectra.resolution,
        notes=notes,
        **data.labels,
    )
