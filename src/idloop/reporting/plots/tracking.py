"""Figure: a reference followed without and with compensation: motion, error and command, below each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from idloop import drawing
from idloop.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from idloop.control.tracking import Tracking


# Of what is dense, and of lines that only help the eye.
_THIN, _BROAD = 0.6, 4.0


def plot_tracking(
    without: Tracking, compensated: Tracking, output: str, input_name: str, input_unit: str, settle: float = 0.0
) -> Figure:
    """Draw one output; `settle`: seconds at the start that the errors in the legend leave out."""
    column = without.names.index(output)
    unit = without.units[column]
    runs = (("without compensation", without, 1), ("with compensation", compensated, 0))
    with drawing.styled():
        figure, grid = drawing.new_figure(3, heights=(1.8, 1.8, 1.6))
        motion, error, command = grid[:, 0]
        # Broad and behind the runs: one that follows well would hide a thin line.
        broad = {"color": drawing.COMMAND, "linewidth": _BROAD, "alpha": 0.5}
        drawing.line(motion, without.time, without.wanted[:, column], label="reference", **broad)
        for words, run, look in runs:
            style = drawing.model_look(look)
            drawing.line(motion, run.time, run.output[:, column], label=words, **style)
            size = run.error_of(output, settle).rms
            drawing.line(error, run.time, run.error[:, column], label=f"{words}: rms {size:.3g} {unit}", **style)
            drawing.steps(command, run.time, run.command, **{**style, "linewidth": _THIN})
        error.axhline(0.0, color=drawing.MEASURED, linewidth=_THIN)
        for axes, shown in ((motion, without.wanted), (error, without.error)):
            _make_room(axes, shown[:, column])
        motion.set_ylabel(drawing.label(output, unit))
        error.set_ylabel(drawing.label("error", unit))
        command.set(xlabel=drawing.label("time", "s"), ylabel=drawing.label(input_name, input_unit))
        motion.legend(loc="upper right", ncols=3)
        error.legend(loc="upper right", ncols=2)
    return figure


def _make_room(axes: Axes, shown: Array) -> None:
    """Leave a strip above the lines for the legend."""
    low, high = float(np.min(shown)), float(np.max(shown))
    reach = (high - low) or 1.0
    axes.set_ylim(low - 0.1 * reach, high + 0.35 * reach)
