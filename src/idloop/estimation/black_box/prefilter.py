"""Frequency weighting: commands and measurements through one and the same filter before the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias, Union

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData

if TYPE_CHECKING:
    import control

# Numerator and denominator in the delay operator, or a discrete python-control system.
Filter: TypeAlias = Union[tuple[ArrayLike, ArrayLike], "control.TransferFunction", "control.StateSpace"]


def prefiltered(data: Sequence[SampledData], prefilter: Filter | None) -> list[SampledData]:
    """Filter commands and measurements alike, which weighs the fit by the filter's magnitude.

    The plant between filtered signals is the plant between the signals (Ljung, System Identification, 2nd ed.,
    eq. 7.13 and 8.71). The filter starts at rest at the first sample; its transient is cut off.

    `prefilter`: coefficients of 1, q^-1, ..., or a discrete system; None leaves the data as they are. Raises
    InputError: an unstable filter, one of another sample time or with several inputs or outputs, or a record that is
    shorter than the filter's memory.
    """
    if prefilter is None:
        return list(data)
    from scipy.signal import lfilter, lfilter_zi

    # A module-level import would be circular: the polynomial methods import this file.
    from idloop.estimation.polynomial.polynomials import radius

    numerator, denominator = _coefficients(prefilter, data[0].sample_time)
    if denominator[0] == 0.0 or radius(denominator / denominator[0]) >= 1.0:
        raise InputError("prefilter: its denominator must start with a number other than 0 and have stable roots")
    size = radius(denominator / denominator[0])
    memory = len(numerator) + (int(np.ceil(np.log(1e-3) / np.log(size))) if size > 1e-6 else 0)
    rest = lfilter_zi(numerator, denominator)
    filtered = []
    for one in data:
        if len(one) < 2 * memory:
            raise InputError(
                f"{one.name}: {len(one)} samples, but the prefilter remembers {memory}; record longer or filter less"
            )
        signals = [
            np.column_stack([lfilter(numerator, denominator, x, zi=rest * x[0])[0] for x in side.T])
            for side in (one.input, one.output)
        ]
        filtered.append(replace(one, input=signals[0], output=signals[1]).part(memory, len(one)))
    return filtered


def band_filter(low: float, high: float, sample_time: float) -> Filter:
    """Butterworth filter of second order that weighs a fit towards a band."""
    from scipy.signal import butter

    nyquist = 0.5 / sample_time
    if not 0.0 <= low < high:
        raise InputError(f"band of {low:g} to {high:g} Hz is empty; give the lower edge first")
    if low >= nyquist or (np.isfinite(high) and high >= nyquist):
        raise InputError(f"band of {low:g} to {high:g} Hz; both edges lie below half the sample rate, {nyquist:g} Hz")
    if low == 0.0 and not np.isfinite(high):
        raise InputError("a band that is open on both sides weighs nothing; give an edge")
    if low == 0.0:
        edges, kind = [high], "lowpass"
    elif not np.isfinite(high):
        edges, kind = [low], "highpass"
    else:
        edges, kind = [low, high], "bandpass"
    numerator, denominator = butter(2, edges if len(edges) > 1 else edges[0], kind, fs=1.0 / sample_time)
    return numerator, denominator


def _coefficients(prefilter: Filter, sample_time: float) -> tuple[Array, Array]:
    """Numerator and denominator as coefficients of 1, q^-1, ..."""
    if isinstance(prefilter, (tuple, list)):
        numerator, denominator = (np.atleast_1d(np.asarray(part, dtype=float)) for part in prefilter)
        return numerator, denominator
    import control

    system = control.tf(prefilter)
    if (system.ninputs, system.noutputs) != (1, 1):
        raise InputError(f"prefilter with {system.ninputs} inputs and {system.noutputs} outputs; give one of each")
    if not system.dt or (system.dt is not True and abs(system.dt - sample_time) > 1e-3 * sample_time):
        raise InputError(f"prefilter with sample time {system.dt}; make it discrete at {sample_time:g} s")
    numerator, denominator = (np.ravel(np.asarray(part[0][0], dtype=float)) for part in (system.num, system.den))
    return np.concatenate([np.zeros(len(denominator) - len(numerator)), numerator]), denominator
