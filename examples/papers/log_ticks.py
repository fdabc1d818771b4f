"""Ticks of a logarithmic axis that spans little more than a decade."""

from __future__ import annotations

from typing import Any


def plain_ticks(*axes: Any) -> None:
    """Write 0.2, 0.5, 1, 2, ... at logarithmic axes instead of powers of ten that run into each other."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in axes:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
