"""Averaged cross spectra of several signals, and the frequency response that they tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.nonparametric.frequency_response import FrequencyResponse

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Trend = Literal["constant", "linear", "none"]

_SILENT = 1e-12  # an input's power at a line below this share of its greatest is rounding, not excitation
_TOGETHER = 1e-8  # inputs whose coherence matrix is closer to singular than this cannot be told apart


@dataclass(frozen=True, eq=False)
class CrossSpectra:
    """Averaged spectra of several signals.

    `resolution`: width of what is averaged over, at half its height [Hz]; None where every line is its own.
    """

    frequency: Array  # shape (f,): [Hz]
    matrix: Complex  # shape (f, c, c): one-sided cross power densities ``E[Z Zᴴ]`` [product of the signals' units / Hz]
    averages: float  # number of independent averages that the estimate is worth
    samples: int  # that it rests on
    resolution: float | None = None


def without_trend(values: Array, trend: Trend) -> Array:
    """Columns without their mean or their straight line, shape (n, c).

    Raises InputError: a trend that is not known.
    """
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
    stands still, or inputs that move together.
    """
    first = data[0]
    p, m = first.output.shape[1], first.input.shape[1]
    matrix = spectra.matrix
    power = np.einsum("fii->fi", matrix).real
    excited = _excited(power[:, p:], first)
    matrix, power = matrix[excited], power[excited]
    size = np.sqrt(power[:, p:])
    inputs = matrix[:, p:, p:] / (size[:, :, None] * size[:, None, :])
    if m > 1 and np.min(np.linalg.eigvalsh(inputs)[:, 0]) < _TOGETHER:
        raise InputError(
            f"{first.name}: the inputs {', '.join(first.input_names)} move together, so their effects cannot be told"
            " apart; excite them independently, or smooth over more lines"
        )
    inverse = np.linalg.inv(inputs) / (size[:, :, None] * size[:, None, :])
    response = matrix[:, :p, p:] @ inverse
    explained = np.einsum("fij,fji->fi", response, matrix[:, p:, :p]).real
    outputs = power[:, :p]
    # What is left of the output is never less than rounding leaves of it.
    left = np.maximum(outputs - explained, 4 * np.finfo(float).eps * np.abs(outputs))
    spare = spectra.averages - m
    known = spare > 0.5
    disturbance = left * (spectra.averages / spare) if known else np.full_like(left, np.nan)
    inverse_diagonal = np.einsum("fii->fi", inverse).real
    variance = disturbance[:, :, None] * inverse_diagonal[:, None, :] / spectra.averages
    coherence = np.clip(np.where(outputs > 0, explained / np.where(outputs > 0, outputs, 1.0), 0.0), 0.0, 1.0)
    drowned = int(np.sum(np.any(outputs <= 0, axis=1)))
    if drowned:
        notes = (*notes, f"at {drowned} lines an output holds less than leaks in from others; lengthen the window")
    dropped = int(np.sum(~excited))
    if dropped:
        notes = (*notes, f"{dropped} of {excited.size} lines carry no input and are left out")
    return FrequencyResponse(
        method=method,
        frequency=spectra.frequency[excited],
        response=response,
        stderr=np.sqrt(variance),
        degrees=np.full(len(response), 2.0 * spare if known else np.nan),
        coherence=coherence if known else None,
        disturbance=disturbance if known else None,
        disturbance_stderr=disturbance / np.sqrt(spare) if known else None,
        samples=spectra.samples,
        resolution=spectra.resolution,
        notes=notes,
        **first.labels,
    )


def _excited(power: Array, data: SampledData) -> NDArray[np.bool_]:
    """Lines at which every input has power, shape (f,)."""
    greatest = np.max(power, axis=0)
    for level, name in zip(greatest, data.input_names, strict=True):
        if not level > 0:
            raise InputError(f"{data.name}: {name} stands still; a response needs an input that moves")
    return np.asarray(np.all(power > _SILENT * greatest, axis=1))
