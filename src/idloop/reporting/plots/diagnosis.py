"""Figure: the shares that effects explain, and the missing effect on the data that ask for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from idloop import drawing
from idloop.p_values import p_text
from idloop.validation.characteristic import Characteristic, characteristic

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.diagnosis import Diagnosis
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
