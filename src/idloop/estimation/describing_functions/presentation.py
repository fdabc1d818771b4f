"""Results as plain values for JSON, and axes for their figures."""

from __future__ import annotations

import math
from typing import Any

from idloop.estimation.describing_functions.element import Floats


def plain(value: float) -> float | None:
    """Return the number, or None where it is not finite."""
    return float(value) if math.isfinite(value) else None


def plain_list(values: Floats) -> list[float | None]:
    """Return the numbers of an array, shape (n,), None where they are not finite."""
    return [plain(value) for value in values.tolist()]


def new_axes(axes: Any = None, rows: int = 1, height: float = 4.0) -> Any:
    """Return the given matplotlib axes, or new ones below each other on one horizontal axis."""
    if axes is not None:
        return axes
    import matplotlib.pyplot as plt

    _, made = plt.subplots(rows, 1, sharex=True, figsize=(8, height), layout="constrained")
    return made


def with_unit(text: str, unit: str) -> str:
    """Label of an axis; the unit is left out where it is not known."""
    return f"{text} [{unit}]" if unit else text
