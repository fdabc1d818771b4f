"""What is said of a model whose poles lie outside the unit circle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# An integrator comes out a little to either side of the circle.
_UNSTABLE = 1.001


def instability_notes(a: NDArray[np.float64]) -> tuple[str, ...]:
    """One note where the free run grows, none otherwise.

    `a` (n, n): state matrix.
    """
    if not np.all(np.isfinite(a)):
        return ()
    radius = float(np.max(np.abs(np.linalg.eigvals(a)), initial=0.0))
    if radius <= _UNSTABLE:
        return ()
    return (f"unstable: its free run grows {radius:.4g} times in a sample; right for such a plant only",)
