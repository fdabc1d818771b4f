"""Figure of a watch: the sum against its threshold with the alarms, and the growth that the data show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.arrays import Array
from idloop.reporting.plots.comparison import legend_above

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.monitoring import Baseline, Trace
    from idloop.records import Record


# Points of growth in a figure, each a mean over its stretch of time.
_POINTS = 30


def plot_wear(baseline: Baseline, records: Sequence[Record], traces: Sequence[Trace]) -> Figure:
    """Draw the figure.

    `traces`: what the monitor made of each record; drawn one after the other.
    """
    with drawing.styled():
        figure, axes = drawing.new_figure(2 * len(baseline.watches), 1, (1.5, 1.8) * len(baseline.watches))
        time, edges = _one_after_the_other(baseline, traces)
        for row, normal in enumerate(baseline.normal):
            watch = normal.watch
            top, below = axes[2 * row, 0], axes[2 * row + 1, 0]
            _draw_sum(top, time, traces, row, normal.threshold)
            top.set_title(watch.parameter, loc="left", fontweight="bold", pad=20)  # clear of the legend
            _draw_growth(below, time, traces, row, watch.growth, normal.offset_stderr / normal.sensitivity)
            top.set_ylabel(drawing.label("evidence", None))
            below.set_ylabel(drawing.label("growth", watch.unit))
            for edge in edges:
                for one in (top, below):
                    one.axvline(edge, color=drawing.BAND, linewidth=0.6, linestyle=":")
        axes[-1, 0].set_xlabel(drawing.label("time of running" if len(records) > 1 else "time", "s"))
        figure.align_ylabels(axes[:, 0])
    return figure


def _one_after_the_other(baseline: Baseline, traces: Sequence[Trace]) -> tuple[Array, list[float]]:
    """Time of each block with the pauses between records taken out [s], and where records begin."""
    found: list[Array] = []
    edges: list[float] = []
    end = 0.0
    for trace in traces:
        if len(trace.index):
            found.append(end + (trace.index - trace.index[0] + 1) * baseline.block)
            edges.append(end)
            end = float(found[-1][-1])
    return (np.concatenate(found) if found else np.zeros(0)), edges[1:]


def _draw_sum(axes: Any, time: Array, traces: Sequence[Trace], row: int, threshold: float) -> None:
    sums = np.concatenate([trace.sums[:, row] for trace in traces])
    drawing.line(axes, time, sums, color=drawing.MODELS[0])
    if np.isfinite(threshold):
        axes.axhline(threshold, color=drawing.MEASURED, linewidth=0.8, linestyle="--", label="alarm above")
        raised = sums > threshold
        if np.any(raised):
            axes.plot(time[raised], sums[raised], "v", color=drawing.MODELS[1], markersize=5, label="alarm")
    legend_above(axes, 2)


def _draw_growth(axes: Any, time: Array, traces: Sequence[Trace], row: int, watched: float, extra: float) -> None:
    growth = np.concatenate([trace.growth[:, row] for trace in traces])
    stderr = np.concatenate([trace.stderr[:, row] for trace in traces])
    at, value, width = [], [], []
    for part in np.array_split(np.arange(len(growth)), max(min(_POINTS, len(growth)), 1)):
        known = part[np.isfinite(growth[part])]
        if len(known):
            weight = 1.0 / stderr[known] ** 2
            at.append(float(np.mean(time[known])))
            value.append(float(np.sum(weight * growth[known]) / np.sum(weight)))
            width.append(1.96 * float(np.hypot(1.0 / np.sqrt(np.sum(weight)), extra)))
    axes.errorbar(
        at, value, width, fmt="o", markersize=3, color=drawing.MODELS[0], ecolor=drawing.BAND, label="data, 95 %"
    )
    axes.axhline(0.0, color=drawing.MEASURED, linewidth=0.6)
    axes.axhline(watched, color=drawing.MODELS[1], linewidth=0.8, linestyle="--", label="growth to be noticed")
    legend_above(axes, 2)
