"""From matrices in scaled units to a linear model, with the innovations that it leaves in the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.linear.error_covariance import error_covariance
from idloop.estimation.linear.instability import instability_notes
from idloop.estimation.linear.model import LinearModel
from idloop.estimation.linear.sensitivity import Matrices
from idloop.estimation.statistics.collinear import together_notes
from idloop.estimation.subspace.compression import Compression

Array = NDArray[np.float64]


def assembled(
    method: str,
    compression: Compression,
    matrices: Matrices,
    singular_values: Array,
    feedthrough: bool,
    notes: tuple[str, ...],
    covariance: Array | None = None,
) -> LinearModel:
    """Model in the signals' own units; its innovation covariance is that of its errors on the data.

    `matrices`: in scaled units; `feedthrough`: whether D was estimated; `covariance` (p, p): of the prediction errors
    in scaled units, where it is known; else the data are predicted.
    """
    first = compression.experiments[0]
    n, m, p = len(matrices.a), compression.inputs, compression.outputs
    command, measure = compression.input_scale, compression.output_scale
    notes += instability_notes(matrices.a)
    model = LinearModel(
        method=method,
        a=matrices.a,
        b=matrices.b / command,
        c=matrices.c * measure[:, None],
        d=matrices.d * measure[:, None] / command,
        gain=matrices.gain / measure,
        covariance=np.zeros((p, p)) if covariance is None else covariance * np.outer(measure, measure),
        **first.labels,
        samples=compression.samples,
        # Of all entries n squared are the choice of the states' coordinates.
        free=n * (m + p) + p * m * feedthrough + n * p * bool(np.any(matrices.gain)),
        singular_values=singular_values,
        notes=notes,
    )
    if covariance is None:
        model = replace(model, covariance=error_covariance(model, compression.experiments))
    return replace(model, notes=(*model.notes, *together_notes(compression.experiments, model)))
