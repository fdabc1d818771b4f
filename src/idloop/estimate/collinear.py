"""Signals that are combinations of each other, and what is said of such commands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.estimate.sampled import SampledData

Array = NDArray[np.float64]

_TOGETHER = 1e-8  # a direction of the signals of less than this part of their size is rounding


def move_together(signals: Array) -> bool:
    """Whether some of several signals, shape (n, k), are a combination of the others at every sample."""
    size = np.linalg.norm(signals, axis=0)
    if signals.shape[1] < 2 or not np.all(size > 0.0):
        return False
    return bool(np.linalg.svd(signals / size, compute_uv=False)[-1] <= _TOGETHER)


def together_notes(data: Sequence[SampledData]) -> tuple[str, ...]:
    """One note where some inputs are a combination of others at every sample, none otherwise.

    Parameters
    ----------
    data : sequence of SampledData

    Returns
    -------
    tuple of str
    """
    if not move_together(np.vstack([one.input for one in data])):
        return ()
    return (f"{', '.join(data[0].input_names)} move together: only their common effect is known; excite them apart",)
