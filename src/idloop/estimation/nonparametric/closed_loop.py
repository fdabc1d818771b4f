"""Frequency response of a plant under feedback, by way of the reference."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.nonparametric.frequency_response import FrequencyResponse
from idloop.estimation.nonparametric.welch import averaged, segment_length

_HEARD = 4.0  # the reference's share of the command, in units of what chance alone would give it


def indirect(
    data: SampledData | Sequence[SampledData], segment: int | None = None, *, overlap: float = 0.5
) -> FrequencyResponse:
    """Response S_yr / S_ur from the reference, without the bias that feedback puts into S_yu / S_uu.

    Under feedback the command answers to the disturbance, and S_yu / S_uu leans towards the negative inverse of
    the controller. What output and command have in common with the reference does not (Wellstead 1981;
    Pintelon and Schoukens, 2nd ed., section 2.6.4). The error's mean square is that of the instrumental
    variable: S_ee S_rr / |S_ur|² over the number of averages, with e the part of the output that the estimate
    leaves over.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        One input, and the reference.
    segment, overlap
        As for ``welch``.

    Returns
    -------
    FrequencyResponse
        Its coherence is that between reference and command, shape (f, 1) for all outputs: where it is low, the
        reference does not reach the plant.

    Raises
    ------
    InputError
        No reference, a reference that stands still, or more than one input.
    """
    several = together(data)
    first = several[0]
    if first.input.shape[1] != 1:
        raise InputError(f"{first.name}: {first.input.shape[1]} inputs; one reference tells the response to one input")
    signals = []
    for one in several:
        if one.reference is None:
            raise InputError(f"{one.name}: no reference recorded; record it, or use welch if the loop was open")
        if not np.all(np.isfinite(one.reference)):
            raise InputError(f"{one.name}: reference holds NaN or infinite samples; cut them out first")
        signals.append(np.column_stack([one.output, one.input, one.reference]))
    length = segment_length(several, segment, overlap)
    spectra = averaged(signals, length, overlap, first.sample_time)
    p = first.output.shape[1]
    matrix = spectra.matrix
    reference, command = matrix[:, p + 1, p + 1].real, matrix[:, p, p].real
    if not (np.max(reference) > 0 and np.max(command) > 0):
        still = "reference" if not np.max(reference) > 0 else first.input_names[0]
        raise InputError(f"{first.name}: {still} stands still; a response needs a reference that moves")
    moves = (reference > 1e-12 * np.max(reference)) & (command > 1e-12 * np.max(command))
    matrix, reference, command = matrix[moves], reference[moves], command[moves]
    through = matrix[:, p, p + 1]
    heard = np.abs(through) ** 2 / (reference * command)
    response = matrix[:, :p, p + 1] / through[:, None]
    outputs = np.einsum("fii->fi", matrix[:, :p, :p]).real
    left = outputs - 2 * np.real(np.conj(response) * matrix[:, :p, p]) + np.abs(response) ** 2 * command[:, None]
    left = np.maximum(left, 4 * np.finfo(float).eps * outputs)
    spare = spectra.averages - 1.0
    known = spare > 0.5
    disturbance = left * (spectra.averages / spare) if known else np.full_like(left, np.nan)
    variance = disturbance * (reference / np.abs(through) ** 2)[:, None] / spectra.averages
    deaf = int(np.sum(heard * spectra.averages < _HEARD))
    notes = []
    if deaf:
        notes.append(f"at {deaf} of {heard.size} lines the reference hardly reaches the command; read nothing there")
    if np.any(~moves):
        notes.append(f"{int(np.sum(~moves))} of {moves.size} lines carry no reference and are left out")
    return FrequencyResponse(
        method="indirect",
        frequency=spectra.frequency[moves],
        response=response[:, :, None],
        stderr=np.sqrt(variance)[:, :, None],
        degrees=np.full(len(response), 2.0 * spare if known else np.nan),
        coherence=np.repeat(heard[:, None], p, axis=1),
        disturbance=disturbance if known else None,
        disturbance_stderr=disturbance / np.sqrt(spare) if known else None,
        samples=spectra.samples,
        resolution=spectra.resolution,
        notes=tuple(notes),
        **first.labels,
    )
