"""Figures of a diagnosis and of a ladder: shares, the missing effect on the data, errors by step, unknown shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.p_values import p_text
from idloop.reporting.scores import TRAIN, ErrorLine, error_lines, force_lines, in_decades, step_evidence
from idloop.reporting.terms import effect_words
from idloop.reporting.verdicts import conclusion, scope_text
from idloop.validation.characteristic import Characteristic, characteristic

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.diagnosis import Diagnosis, Ladder, Step, UnknownStructure
    from idloop.records import Record


_MOST = 8  # bars


def plot_diagnosis(found: Diagnosis, records: Sequence[Record]) -> Figure:
    """Draw a bar for each refitted effect, and below it the characteristic of the missing one.

    `records`: those that were diagnosed; the characteristic is read off the first that shows it.
    """
    from matplotlib.figure import Figure as NewFigure

    best = found.best
    shape = None
    if best is not None and best.model is not None:
        model = best.model
        shape = next((one for one in (characteristic(model, best.name, r) for r in records) if one is not None), None)
    weighed = [one for one in found.candidates if one.model is not None][:_MOST]
    heights = [0.32 * max(len(weighed), 1) + 0.5] + ([2.8] if shape is not None else [])
    with drawing.styled():
        figure = NewFigure(figsize=(7.5, sum(heights) + 0.9), layout="constrained")
        axes = figure.subplots(len(heights), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
        places = range(len(weighed))
        colours = [drawing.MODELS[0] if one.name in found.set else drawing.BAND for one in weighed]
        axes[0].barh(places, [100.0 * one.explains for one in weighed], color=colours)
        axes[0].set_yticks(places, [f"{one.name} ({p_text(one.p_value)})" for one in weighed])
        axes[0].invert_yaxis()
        axes[0].set_xlabel(drawing.label("explained part of the error", "%"))
        axes[0].set_title(found.model.name, loc="left", fontweight="bold")
        if shape is not None and best is not None:
            _draw_characteristic(axes[1], shape, best.name)
    return figure


def plot_characteristic(shape: Characteristic, name: str) -> Figure:
    """Draw an effect on the data that ask for it."""
    with drawing.styled():
        figure, axes = drawing.new_figure(1, 1, (2.8,))
        _draw_characteristic(axes[0, 0], shape, name)
        axes[0, 0].set_title(name, loc="left", fontweight="bold")
    return figure


def _draw_characteristic(axes: Any, shape: Characteristic, name: str) -> None:
    axes.plot(shape.x, shape.y, ".", color=drawing.BAND, markersize=2, rasterized=True, label="left by the model")
    axes.errorbar(shape.centre, shape.mean, shape.band, fmt="o", markersize=3, color=drawing.MEASURED, label="mean")
    axes.plot(shape.curve_x, shape.curve_y, color=drawing.MODELS[1], label=name)
    axes.set_xlabel(drawing.label(shape.variable, shape.unit))
    axes.set_ylabel(drawing.label(shape.quantity, shape.quantity_unit))
    axes.legend(loc="best")


_STEP_WIDTH = 1.35


def plot_ladder(ladder: Ladder, floor: Mapping[str, float] | None = None) -> Figure:
    """Draw the errors of every step of a ladder, and the unknown structure when it ends in one.

    `floor`: NRMSE that the noise of each output alone leaves, by its name.
    """
    from matplotlib.figure import Figure

    forces, places = force_lines(ladder), np.arange(len(ladder.steps))
    rows = 1 + bool(forces) + (ladder.unknown is not None)
    width = 4.2 + _STEP_WIDTH * len(ladder.steps)
    with drawing.styled():
        figure = Figure(figsize=(width, 2.4 * rows + 1.3), layout="constrained")
        axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
        errors = int(bool(forces) and ladder.criterion == "force")  # what the steps were judged by comes first
        _draw_errors(axes[errors], error_lines(ladder), floor or {})
        if forces:
            _draw_forces(axes[1 - errors], forces)
            axes[0].set_xticks(places, [""] * len(places))
            # Equal, so that a step stands below itself; the error of the force may end before the ladder does.
            ends = [axes[row].get_xlim() for row in (0, 1)]
            for row in (0, 1):
                axes[row].set_xlim(min(low for low, _ in ends), max(high for _, high in ends))
        axes[int(bool(forces))].set_xticks(places, [step_label(step, ladder) for step in ladder.steps])
        if ladder.unknown is not None:
            _draw_unknown(axes[-1], ladder.unknown)
        axes[0].set_title(
            f"{ladder.steps[0].model.name}: {conclusion(ladder, (), scope_text(ladder)).partition(':')[0]}",
            loc="left",
            fontweight="bold",
        )
        figure.align_ylabels(axes)
    return figure


def plot_unknown(unknown: UnknownStructure) -> Figure:
    """Draw the force that no effect explains, as a curve with its band."""
    with drawing.styled():
        figure, axes = drawing.new_figure(1, 1, (2.6,))
        _draw_unknown(axes[0, 0], unknown)
    return figure


def _draw_errors(axes: Any, lines: list[ErrorLine], floor: Mapping[str, float]) -> None:
    """One colour for each output; what the fit did not see is drawn full, the fitted data dashed."""
    for line in lines:
        _draw_line(axes, line, drawing.MODELS[line.colour % len(drawing.MODELS)])
    for colour, name in dict.fromkeys((line.colour, line.quantity) for line in lines):
        if floor.get(name, np.nan) > 0.0:
            look: dict[str, Any] = {"color": drawing.MODELS[colour % len(drawing.MODELS)], "linestyle": ":"}
            axes.axhline(floor[name], linewidth=0.8, label=f"{name}, noise floor", **look)
    every = (*(line.error for line in lines), np.array(list(floor.values()), dtype=float))
    _scale(axes, "NRMSE of the free run [-]", decades=in_decades(*every))


def _draw_forces(axes: Any, lines: list[ErrorLine]) -> None:
    for line in lines:
        _draw_line(axes, line, drawing.COMMAND)
    # Of unseen data, where there is any.
    for place, value in enumerate(lines[0].error):
        if np.isfinite(value):
            axes.annotate(f"{value:.3g} %", (place, value), (6, 5), textcoords="offset points", fontsize="small")
    _scale(axes, "force error [%]", decades=False)


def _draw_line(axes: Any, line: ErrorLine, colour: str) -> None:
    dashes: Any = (0, (4, 2)) if line.kind == TRAIN and line.use else "-"
    look: dict[str, Any] = {"color": colour, "linestyle": dashes, "marker": "o", "markersize": 3.5}
    axes.plot(np.arange(len(line.error)), line.error, label=line.label, **look)


def _scale(axes: Any, label: str, *, decades: bool) -> None:
    """Decades where the errors span some; the legend beside."""
    from matplotlib.ticker import LogLocator

    if decades:
        axes.set_yscale("log")
        # Plain numbers: a span of one decade or two is read better without powers of ten.
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")
    else:
        axes.margins(y=0.12)
        axes.set_ylim(bottom=0.0)
    axes.set_ylabel(label)
    axes.margins(x=0.08)
    axes.grid(axis="x", visible=False)
    _legend_beside(axes)


def _legend_beside(axes: Any) -> None:
    # Outside the axes: inside, it would lie on the lines somewhere.
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)


def step_label(step: Step, ladder: Ladder) -> str:
    """What a step added, its evidence, and in brackets what the data cannot distinguish it from.

    `ladder`: of which it is one.
    Returns: a few short lines.
    """
    if step.added is None:
        return "start"
    lines = [f"+ {effect_words(step.added.effect)}", f"@ {step.added.at}"]
    lines += [evidence] if (evidence := step_evidence(step)) else []
    lines += [f"[or {effect_words(name)}]" for name in ladder.rivals(step)]
    return "\n".join(lines)


def _draw_unknown(axes: Any, unknown: UnknownStructure) -> None:
    at, force, band = (np.asarray(v, dtype=float) for v in (unknown.at, unknown.force, unknown.band))
    colour = drawing.MODELS[1]
    axes.axhline(0.0, color=drawing.MEASURED, linewidth=0.6)
    axes.fill_between(at, force - band, force + band, color=drawing.BAND, alpha=0.35, linewidth=0, label="95 % band")
    axes.plot(at, force, color=colour, label="estimate")
    axes.set_xlabel(drawing.label(unknown.along, unknown.unit))
    axes.set_ylabel(drawing.label(unknown.what, unknown.force_unit))
    axes.set_title(f"explains {100.0 * unknown.share:.0f} % of the remaining error", loc="left")
    _legend_beside(axes)
