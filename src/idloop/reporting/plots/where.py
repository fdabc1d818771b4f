"""Figure: where models fail, as small multiples.

A block for each error (drive force, outputs), a column for each variable. Above, the share of the squared error
in each bin against the share of the time; below, the mean of the error in each bin, give or take its rms.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.reporting.breakdowns import (
    MARKED_STRETCHES,
    axis_name,
    bin_edges,
    comparable,
    legend_entry,
    measured_error,
    named_ticks,
)
from idloop.validation.breakdown import Breakdown
from idloop.validation.variables import TITLES, VARIABLES
from idloop.validation.where import ErrorMap, Where

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Named = tuple[str, ErrorMap]

# Inches. Left of each column the room for its labels, then its width.
_COLUMNS = ((0.75, 2.9), (0.75, 1.6), (0.8, 1.75), (0.12, 1.75), (0.12, 1.75), (0.4, 1.0), (0.4, 1.9))
# Above shares and values the room for titles and legends, then their heights; the rest is for the labels below.
_ROWS = ((0.34, 1.15), (0.22, 1.3))
_BELOW, _HEAD, _RIGHT = 0.75, 0.35, 0.12


def plot_where(models: Sequence[tuple[str, Where]]) -> Figure:
    """Draw where models fail on the same record, by their labels."""
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(one.name for _, where in models for one in where.maps))
    width = sum(room + wide for room, wide in _COLUMNS) + _RIGHT
    block_height = sum(room + tall for room, tall in _ROWS) + _BELOW
    height = block_height * max(len(names), 1) + _HEAD
    with drawing.styled(), drawing.short_numbers():
        figure = Figure(figsize=(width, height))
        figure.text(
            0.12 / width, 1.0 - 0.12 / height, f"Where the model fails on {models[0][1].record}",
            ha="left", va="top", fontsize=10.0, fontweight="bold",
        )  # fmt: skip
        for block, name in enumerate(names):
            maps = comparable([(label, one) for label, where in models for one in where.maps if one.name == name])
            _draw_block(_new_block(figure, width, height, _HEAD + block * block_height), maps)
    return figure


def _new_block(figure: Figure, width: float, height: float, top: float) -> Any:
    """Axes of one block, (rows, columns), at fixed places: equal figures are equal files, and quickly drawn."""
    bottom = top + sum(room + tall for room, tall in _ROWS)
    grid = figure.add_gridspec(
        2 * len(_ROWS), 2 * len(_COLUMNS), wspace=0.0, hspace=0.0, left=0.0, right=1.0 - _RIGHT / width,
        top=1.0 - top / height, bottom=1.0 - bottom / height,
        width_ratios=np.ravel(_COLUMNS), height_ratios=np.ravel(_ROWS),
    )  # fmt: skip
    rows, columns = range(len(_ROWS)), range(len(_COLUMNS))
    return np.array([[figure.add_subplot(grid[2 * r + 1, 2 * c + 1]) for c in columns] for r in rows])


def _draw_block(axes: Any, maps: list[Named]) -> None:
    """One error: its title, the shares above, the values below."""
    shares, means = [], []
    for column, variable in enumerate(VARIABLES):
        top, below = axes[:, column]
        drawn = [(i, one, b) for i, (_, one) in enumerate(maps) if (b := one.along(variable)) is not None]
        if not drawn:
            _leave_out(top, below, TITLES[variable], maps[0][1].left_out.get(variable, ""))
            continue
        if variable not in {"frequency", "direction"}:  # few bins hold so much that they would flatten the others
            shares.append(top)
        if variable not in {"time", "frequency"}:
            means.append(below)
        for index, one, breakdown in drawn:
            color = drawing.model_look(index)["color"]
            _draw_shares(top, breakdown, f"error of {legend_entry(maps, index)}", color, first=index == drawn[0][0])
            _draw_values(below, one, breakdown, color, rank=len(maps) == 1)
        _label(top, below, drawn[0][2], maps[0][1].unit)
        top.set_ylim(bottom=0.0)
    _link(shares)
    _link(means)
    if means:
        means[0].set_ylabel(drawing.label("mean ± rms", maps[0][1].unit))
    axes[0, 0].set_ylabel(drawing.label("share", "%"))
    axes[0, 0].set_title(measured_error(maps[0][1]), loc="left", fontweight="bold", pad=6)
    entries = axes[0, 0].get_legend_handles_labels()
    axes[0, -1].legend(
        *entries, loc="lower right", bbox_to_anchor=(1.0, 1.02), borderaxespad=0.0, ncols=len(entries[1])
    )  # fmt: skip


def _link(axes: list[Any]) -> None:
    """Give axes one scale, labelled once."""
    if not axes:
        return
    limits = np.array([one.get_ylim() for one in axes])
    for one in axes[1:]:
        one.sharey(axes[0])
        one.tick_params(labelleft=False)
    axes[0].set_ylim(np.min(limits), np.max(limits))


def _draw_shares(axes: Any, breakdown: Breakdown, label: str, color: str, first: bool) -> None:
    edges = bin_edges(breakdown)
    if first:
        axes.stairs(
            100.0 * breakdown.usual, edges, fill=True, color=drawing.BAND, alpha=0.45,
            label="usual share (of the time; along frequency of the signal's power)",
        )  # fmt: skip
    axes.stairs(100.0 * breakdown.error, edges, color=color, linewidth=1.6, label=label)
    if breakdown.variable == "frequency":
        axes.set_xscale("log")


def _draw_values(axes: Any, one: ErrorMap, breakdown: Breakdown, color: str, rank: bool) -> None:
    """Error over time, rms over frequency, mean and rms over everything else."""
    if breakdown.variable == "time":
        drawing.line(axes, one.time, one.error, color=color, linewidth=0.7)
        if rank:
            _mark_worst(axes, one)
        return
    edges = bin_edges(breakdown)
    if breakdown.variable == "frequency":
        axes.stairs(breakdown.rms, edges, color=color, linewidth=1.4, baseline=None)
        axes.set_xscale("log")
        return
    rms = np.nan_to_num(breakdown.rms)
    axes.stairs(rms, edges, baseline=-rms, fill=True, color=color, alpha=0.18, linewidth=0.0)
    axes.stairs(breakdown.mean, edges, color=color, linewidth=1.6, baseline=None)


def _mark_worst(axes: Any, one: ErrorMap) -> None:
    for number, stretch in enumerate(one.loud_stretches[:MARKED_STRETCHES], start=1):
        axes.axvspan(stretch.start, stretch.stop, color=drawing.MODELS[1], alpha=0.25, linewidth=0.0)
        axes.annotate(
            str(number), (0.5 * (stretch.start + stretch.stop), 1.0), xycoords=("data", "axes fraction"),
            ha="center", va="bottom", fontsize=7.5, color=drawing.MODELS[1],
        )  # fmt: skip


def _label(top: Any, below: Any, breakdown: Breakdown, unit: str) -> None:
    """Name and unit under each column, ticks that fit its bins."""
    variable = breakdown.variable
    top.tick_params(labelbottom=False)
    below.set_xlabel(drawing.label(*axis_name(breakdown)))
    if variable in {"frequency", "time"}:
        below.set_ylabel(drawing.label("rms" if variable == "frequency" else "error", unit))
    if variable == "frequency":
        below.set_ylim(bottom=0.0)
    else:
        below.axhline(0.0, color=drawing.MEASURED, linewidth=0.6)
    ticks = named_ticks(breakdown)
    for axes in (top, below) if ticks else ():
        axes.set_xticks(list(ticks), list(ticks.values()), rotation=60 if variable == "since_reversal" else 0)
        if variable == "since_reversal" and len(breakdown.names) == len(ticks):
            axes.annotate(
                "before", (len(breakdown.names) - 0.5, 1.0), xycoords=("data", "axes fraction"), ha="center",
                va="top", fontsize=7.0, color=drawing.COMMAND, rotation=90,
            )  # fmt: skip
        elif variable == "position":
            for last in axes.get_xticklabels()[-1:]:
                last.set_horizontalalignment("right")  # clear of the first one of the next column


def _leave_out(top: Any, below: Any, title: str, why: str) -> None:
    """Say in place of the panels why they are not there."""
    centred: dict[str, Any] = {"ha": "center", "va": "center", "wrap": True}
    top.text(0.5, 0.5, f"{title}:\n{why}", transform=top.transAxes, color=drawing.COMMAND, **centred)
    for axes in (top, below):
        axes.set_axis_off()
