"""Results as plain values for JSON, and axes for their figures."""

from __future__ import annotations

import math

from idloop.arrays import Array


def plain(value: float) -> float | None:
    """Return the number, or None where it is not finite."""
    return float(value) if math.isfinite(value) else None


def plain_list(values: Array) -> list[float | None]:
    """Return the numbers of an array, shape (n,), None where they are not finite."""
    return [plain(value) for value in values.tolist()]


def with_unit(text: str, unit: str) -> str:
    """Label of an axis; the unit is left out where it is not known."""
    return f"{text} [{unit}]" if unit else text
