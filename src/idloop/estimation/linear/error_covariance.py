"""What a linear model leaves of measured outputs, as one covariance over all experiments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear.model import LinearModel

Array = NDArray[np.float64]
Focus = Literal["prediction", "simulation"]


def error_covariance(model: LinearModel, experiments: Sequence[SampledData], focus: Focus = "prediction") -> Array:
    """Mean product of the errors, the first state of each experiment estimated.

    `focus`: errors one step ahead or of the free run. Returns shape (p, p): [output units squared]; infinite where the
    errors overflow.
    """
    p = model.c.shape[0]
    total, count = np.zeros((p, p)), 0
    for one in experiments:
        errors = model.innovations(one) if focus == "prediction" else one.output - model.simulate(one)
        with np.errstate(all="ignore"):
            total += errors.T @ errors
        count += len(errors)
    return np.where(np.isfinite(total), total / count, np.inf)
