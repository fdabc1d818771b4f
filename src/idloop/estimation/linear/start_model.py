"""A python-control system as the model that a search starts from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear.conversion import c2d
from idloop.estimation.linear.model import LinearModel

if TYPE_CHECKING:
    import control


def start_model(start: LinearModel | control.StateSpace | control.TransferFunction, data: SampledData) -> LinearModel:
    """A model with the signals of the data; one that is a LinearModel already as it is.

    `start`: of a python-control system the Kalman gain is zero; a continuous one is sampled, its commands held. Raises
    InputError: neither of these, or a system with other numbers of inputs and outputs than the data.
    """
    import control

    if isinstance(start, LinearModel):
        return start
    if not isinstance(start, control.StateSpace | control.TransferFunction):
        raise InputError(
            f"start model of type {type(start).__name__}; give a LinearModel, as the estimators return, or a"
            " python-control StateSpace or TransferFunction"
        )
    outputs, inputs = data.output.shape[1], data.input.shape[1]
    if (start.ninputs, start.noutputs) != (inputs, outputs):
        raise InputError(
            f"{data.name}: {inputs} inputs and {outputs} outputs; the start model has {start.ninputs} and"
            f" {start.noutputs}"
        )
    sampled: Any = control.ss(c2d(start, data.sample_time) if start.isctime(strict=True) else start)
    labels = data.labels | {"sample_time": data.sample_time if sampled.dt in (None, True) else float(sampled.dt)}
    return LinearModel(
        method="given",
        a=np.asarray(sampled.A, dtype=float),
        b=np.asarray(sampled.B, dtype=float),
        c=np.asarray(sampled.C, dtype=float),
        d=np.asarray(sampled.D, dtype=float),
        gain=np.zeros((sampled.nstates, outputs)),
        covariance=np.full((outputs, outputs), np.nan),
        samples=0,
        free=0,
        **labels,
    )
