"""Axes for results that draw themselves."""

from __future__ import annotations

from typing import Any


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
