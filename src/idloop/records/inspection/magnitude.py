"""Values with which no double can compute: too large to be squared, or a motion that an offset hides."""

from __future__ import annotations

import numpy as np

# Larger values, and smaller motions than its inverse, are no measurement: their products would leave the range of a
# double.
LARGEST = 1e50
# Coarsest step of a double in a motion, as a share of it.
COARSEST = 1e-4


def unusable_magnitude(signal: str, lowest: float, highest: float) -> str:
    """Say why a signal between two values cannot be computed with.

    Returns
    -------
    str
        What is wrong and how to mend it; empty where nothing is.
    """
    largest, span = max(abs(lowest), abs(highest)), highest - lowest
    if largest > LARGEST:
        return f"{signal} reaches {largest:.3g}: no measurement is above {LARGEST:g}; check its unit and how it is read"
    if 0.0 < span < 1.0 / LARGEST:
        return f"{signal} varies by {span:.3g} only; check its unit and how it is read"
    step = float(np.spacing(largest))
    if step > COARSEST * span > 0.0:
        return (
            f"{signal} is about {largest:.3g} and varies by {span:.3g}: numbers of that size have steps of {step:.2g};"
            " subtract its offset where it is recorded or imported"
        )
    return ""
