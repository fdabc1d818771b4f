"""Figures of black-box identification: several methods on one page, and a sweep over one setting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.arrays import Array, Complex
from idloop.estimation.black_box.labels import ratio_unit
from idloop.reporting.plots.comparison import legend_above
from idloop.spelling import listed
from idloop.validation.words import fit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from idloop.estimation.black_box.method import Identified
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.validation.score import Score


_WIDE = 1.96  # standard errors to each side of a band of 95 %
_MOST_FITS = 3  # that fit above a panel
_LOWEST = 3e-4  # of the sample rate, where no response says from where it knows something


@dataclass(frozen=True, eq=False)
class Drawn:
    """A method's result with its score."""

    label: str
    found: Identified
    score: Score | None  # None for responses


Looks = Sequence[tuple[Drawn, dict[str, Any]]]


@dataclass(frozen=True)
class SweepLine:
    """One method over the values of a sweep."""

    label: str
    value: Array  # shape (k,): those that gave a model
    # shape (k,): mean FIT over the outputs [%]
    free_run: Array
    ahead: Array


def plot_identification(drawn: Sequence[Drawn], data: Sequence[SampledData], title: str = "") -> Figure:
    """Draw Bode diagrams with bands, singular values or impulse responses, the validation data and coefficients.

    A column for each output. `data`: on which the models were judged; the longest stretch is drawn. `title`: what the
    data are.
    """
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    first = data[0]
    # A result looks the same in every panel.
    every = [(one, drawing.model_look(index)) for index, one in enumerate(drawn)]
    impulses = [(one, look) for one, look in every if hasattr(one.found.model, "lag")]
    bode = [
        (one, look)
        for one, look in every
        if not hasattr(one.found.model, "lag") and hasattr(one.found.model, "response")
    ]
    singular = [(one, look) for one, look in every if getattr(one.found.linear, "singular_values", None) is not None]
    judged = [(one, look) for one, look in every if one.score is not None]
    followed = [one for one in drawn if one.found.history]
    shown = ((2.2, bode), (1.6, bode), (2.0, impulses), (2.2, judged), (1.4, judged))
    heights = [height for height, panels in shown if panels] + [1.5] * (2 * len(followed)) + [2.0] * bool(singular)
    columns = len(first.output_names)
    with drawing.styled():
        figure = Figure(figsize=(max(7.5, 4.6 * columns), sum(heights) + 0.9), layout="constrained")
        grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)
        for column in range(columns):
            rows = iter(range(len(heights)))

            def next_axes(shared: Any = None, rows: Any = rows, column: int = column) -> Any:
                return figure.add_subplot(grid[next(rows), column], sharex=shared)

            if bode:
                magnitude = next_axes()
                _draw_bode(magnitude, next_axes(magnitude), bode, first, column)
            if impulses:
                _draw_impulses(next_axes(), impulses, column)
            if judged:
                top = next_axes()
                _draw_validation(top, next_axes(top), judged, data, column, title)
            for one in followed:
                top = next_axes()
                _draw_history(top, next_axes(top), one, column)
        if singular:
            _draw_singular_values(figure.add_subplot(grid[-1, :]), singular)
        figure.align_ylabels()
        # One legend above all panels.
        lines = [Line2D([], [], color=drawing.MEASURED, linewidth=1.6, label="measured")] if judged else []
        lines += [Line2D([], [], label=one.label, **look) for one, look in every]
        figure.legend(handles=lines, loc="outside upper left", ncols=min(len(lines), 6))
    return figure


def plot_sweep(name: str, unit: str | None, lines: Sequence[SweepLine], steps: int, title: str = "") -> Figure:
    """Draw FIT over the swept setting, free run above the prediction `steps` samples ahead."""
    with drawing.styled():
        figure, axes = drawing.new_figure(2, 1, (2.2, 2.2))
        top, bottom = axes[:, 0]
        for index, line in enumerate(lines):
            look = drawing.model_look(index)
            top.plot(line.value, _shown(line.free_run), marker="o", markersize=4, label=line.label, **look)
            bottom.plot(line.value, _shown(line.ahead), marker="o", markersize=4, label=line.label, **look)
        top.set_title(title, loc="left")
        top.set_ylabel(drawing.label("FIT, free run", "%"))
        bottom.set_ylabel(drawing.label(f"FIT, {steps} ahead", "%"))
        bottom.set_xlabel(drawing.label(name, unit))
        if unit in {None, "samples"}:
            _whole_numbers(bottom)
        good = [fit for line in lines for fit in (*line.free_run, *line.ahead) if np.isfinite(fit)]
        if good:
            # A model that runs away would press all others onto one line.
            low = max(min(good), max(good) - 120.0)
            room = 0.08 * max(max(good) - low, 1.0)
            top.set_ylim(low - room, max(good) + room)
        top.legend()
    return figure


def _whole_numbers(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _shown(fit: Array) -> Array:
    return np.where(np.isfinite(fit), fit, np.nan)


def _frequencies(bode: Looks, data: SampledData) -> Array:
    """Where models are drawn: from the lowest line that a response knows, else from the length of the record."""
    responses: list[Any] = [one.found.model for one, _ in bode if hasattr(one.found.model, "frequency")]
    known = [model.frequency[model.resolved][0] for model in responses]
    lowest = min(known) if known else max(1.0 / (len(data) * data.sample_time), _LOWEST / data.sample_time)
    return np.geomspace(lowest, 0.5 / data.sample_time, 400)


def _draw_bode(magnitude: Axes, phase: Axes, bode: Looks, data: SampledData, column: int) -> None:
    grid = _frequencies(bode, data)
    # Models first: a measured phase is drawn at the turn that lies nearest to theirs.
    nearest: tuple[Array, Array] | None = None
    shaded = []
    for one, usual in sorted(bode, key=lambda one: one[0].found.linear is None):
        frequency, value, size_error, angle_error = _response(one.found, column, grid)
        look = usual
        size = np.abs(value)
        angle = _phase(frequency, value, nearest, model=one.found.linear is not None)
        if nearest is None and one.found.linear is not None:
            nearest = frequency, angle
        banded = bool(np.any(np.isfinite(size_error)))
        if not banded and one.found.linear is None:
            # Neighbouring lines of a raw response have nothing to do with each other.
            look = {"color": look["color"], "linestyle": "none", "marker": ".", "markersize": 2}
        drawing.line(magnitude, frequency, size, **look)
        drawing.line(phase, frequency, angle, **look)
        if banded:
            shaded.append(one.label)
            shade = {"color": look["color"], "alpha": 0.2, "linewidth": 0}
            # A band that reaches zero has no lower edge on a logarithmic axis: it ends below the curve.
            lower = np.maximum(size - size_error, 0.3 * np.min(size))
            magnitude.fill_between(frequency, lower, size + size_error, **shade)
            turn = np.minimum(np.degrees(angle_error), 180.0)
            phase.fill_between(frequency, angle - turn, angle + turn, **shade)
        distortion = getattr(one.found.model, "distortion", None)
        if distortion is not None:
            distortion.draw_levels(magnitude, column)
            legend_above(magnitude, 2)
    of = "" if len(shaded) == len(bode) else f" of {listed(shaded)}"
    bands = f", bands of 95 %{of}" if shaded else ""
    magnitude.set(xscale="log", yscale="log")
    magnitude.set_title(f"{data.input_names[0]} → {data.output_names[column]}{bands}", loc="left")
    magnitude.set_ylabel(drawing.label("magnitude", ratio_unit(data.output_units[column], data.input_units[0])))
    magnitude.tick_params(labelbottom=False)
    phase.set_ylabel(drawing.label("phase", "deg"))
    phase.set_xlabel(drawing.label("frequency", "Hz"))


def _phase(frequency: Array, value: Complex, nearest: tuple[Array, Array] | None, *, model: bool) -> Array:
    """Phase [deg] without jumps; of a measured response the turn next to a model's, else within one turn of -90."""
    angle, smooth = np.degrees(np.angle(value)), np.asarray(np.degrees(np.unwrap(np.angle(value))))
    if model:
        return smooth
    if nearest is None and np.ptp(smooth) < 720.0:
        return smooth
    about = np.full(angle.shape, -90.0) if nearest is None else np.interp(frequency, *nearest)
    return np.asarray(about + (angle - about + 180.0) % 360.0 - 180.0)


def _response(found: Identified, column: int, grid: Array) -> tuple[Array, Complex, Array, Array]:
    """Frequencies, response, and half widths of its 95 % bands in size and angle [rad]; NaN where none is known."""
    model: Any = found.model
    if found.linear is None:
        kept = model.resolved
        value, radius = model.response[kept, column, 0], model.radius(0.95)[kept, column, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            # A circle that holds the origin says nothing of the phase.
            turn = np.where(radius < np.abs(value), np.arcsin(np.minimum(radius / np.abs(value), 1.0)), np.pi)
        return model.frequency[kept], value, radius, np.where(np.isfinite(radius), turn, np.nan)
    polynomials = getattr(model, "polynomials", ())
    if polynomials and len(polynomials[column].b) == len(model.input_names):
        from idloop.estimation.polynomial.polynomials import response_error

        value, size_error, angle_error = response_error(polynomials[column], 0, grid)
        return grid, value, _WIDE * size_error, _WIDE * angle_error
    nothing = np.full(grid.shape, np.nan)
    return grid, model.response(grid)[:, column, 0], nothing, nothing


def _draw_impulses(axes: Axes, impulses: Looks, column: int) -> None:
    for one, look in impulses:
        model: Any = one.found.model
        half, null = model.band(0.95)[:, column], float(model.null_band(0.95)[column])
        axes.axhspan(-null, null, color=drawing.BAND, alpha=0.3, linewidth=0, label="no response, 95 %")
        axes.errorbar(
            model.time, model.response[:, column], half, fmt=".", color=look["color"], markersize=4, linewidth=0.6,
            label="with 95 % bands",
        )  # fmt: skip
        axes.set_ylabel(drawing.label("weight", ratio_unit(model.output_units[column], model.input_unit)))
        axes.set_title(f"{model.input_name} → {model.output_names[column]}")
    axes.set_xlabel(drawing.label("lag", "s"))
    axes.legend()


def _draw_validation(
    top: Axes, below: Axes, judged: Looks, data: Sequence[SampledData], column: int, title: str
) -> None:
    longest, shown = max(enumerate(data), key=lambda one: len(one[1]))
    measured = shown.output[:, column]
    drawing.line(top, shown.time, measured, color=drawing.MEASURED, linewidth=1.6)
    below.axhline(0.0, color=drawing.MEASURED, linewidth=0.6)
    reach = 3.0 * max(float(np.ptp(measured)), 1e-300)
    middle = float(np.mean(measured))
    for one, look in judged:
        score: Any = one.score
        run = score.simulated[longest][:, column]
        # A free run that runs away is drawn as far as it is of use.
        run = np.where(np.abs(run - middle) < reach, run, np.nan)
        drawing.line(top, shown.time, run, label=f"FIT {fit_text(score.free_run[column], 3, ' %')}", **look)
        drawing.line(below, shown.time, measured - run, **look)
    top.set_title(f"{title or shown.name}: free run", loc="left", pad=6 if len(judged) > _MOST_FITS else 20)
    top.set_ylabel(drawing.label(shown.output_names[column], shown.output_units[column]))
    top.tick_params(labelbottom=False)
    # More are read in the table.
    if len(judged) <= _MOST_FITS:
        legend_above(top, len(judged))
    below.set_ylabel(drawing.label("residual", shown.output_units[column]))
    below.set_xlabel(drawing.label("time", "s"))


def _draw_history(top: Axes, below: Axes, one: Drawn, column: int) -> None:
    """Coefficients as they were at each instant of the fit: those without a unit above those of the command."""
    history = one.found.history[column]
    model: Any = one.found.model
    of_command = [index for index, name in enumerate(history.names) if name.startswith("b")]
    others = [index for index, name in enumerate(history.names) if not name.startswith("b")]
    for axes, coefficients in ((top, others), (below, of_command)):
        history.draw(axes, coefficients)
        if coefficients:
            legend_above(axes, min(len(coefficients), 3))
    top.set_title(f"{one.label}: coefficients as they went; the free run has the last ones", loc="left", pad=20)
    top.set_ylabel(drawing.label("coefficient", None))
    top.tick_params(labelbottom=False)
    below.set_ylabel(drawing.label("coefficient", ratio_unit(model.output_units[column], model.input_units[0])))
    below.set_xlabel(drawing.label("time of the fit", "s"))


def _draw_singular_values(axes: Axes, singular: Looks) -> None:
    for one, look in singular:
        model: Any = one.found.model
        number = np.arange(1, len(model.singular_values) + 1)
        relative = model.singular_values / model.singular_values[0]
        kept = number <= model.order
        axes.semilogy(number[kept], relative[kept], "o", color=look["color"], markersize=5)
        axes.semilogy(number[~kept], relative[~kept], "o", color=look["color"], markersize=4, fillstyle="none")
    axes.set_xlabel(drawing.label("number", None))
    axes.set_ylabel(drawing.label("singular value, relative", None))
    axes.set_title("filled: kept", loc="left")
    _whole_numbers(axes)
