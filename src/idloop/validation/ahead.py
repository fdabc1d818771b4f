"""Prediction some steps ahead, from what the observer knows at each sample."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.physics import Engine

Array = NDArray[np.float64]


def steps_ahead(engine: Engine, data: Data, gain: Array, steps: int, initial_state: Array) -> Array:
    """Predict every sample from the measurements up to ``steps`` samples before it.

    Parameters
    ----------
    engine : Engine
        Model with the values of its file.
    data : Data
        Record.
    gain : array, shape (2 b + 1, p)
        Observer gain.
    steps : int
        How far ahead, in samples.
    initial_state : array
        State at the first sample.

    Returns
    -------
    array, shape (n, p)
        Predictions; NaN for the first ``steps`` samples.

    Raises
    ------
    InputError
        If ``steps`` is not at least 1 and below the number of samples.
    """
    from idloop.physics import kernel

    n, p = data.output.shape
    if not 1 <= steps < n:
        raise InputError(f"cannot predict {steps} steps ahead in {n} samples; choose 1 .. {n - 1}")
    layout = engine.layout(None).under(data.conditions)
    state, history = layout.new_state(), layout.new_history()
    state[kernel.DISTURBANCE : kernel.FIRST + 3 * layout.bodies] = initial_state[
        kernel.DISTURBANCE : kernel.FIRST + 3 * layout.bodies
    ]
    state[kernel.TIME] = data.time[0]
    delay = float(layout.axis.constants[kernel.DELAY])
    before = int(np.searchsorted(data.input_time, data.time[0] - delay, side="left")) - 1
    state[kernel.COMMAND] = float(max(before, -1))
    prediction = np.full((n, p), np.nan)
    kernel.predict_ahead(
        layout.axis, data.input_time, data.input, data.time, data.output, np.ascontiguousarray(gain), steps,
        state, history, prediction,
    )  # fmt: skip
    return prediction
