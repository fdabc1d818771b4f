"""Figure: the ladder, error by step down to the noise floor, and the curve of what no effect explains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.reporting.terms import DATA_USE, effect_words, p_text
from idloop.reporting.verdicts import conclusion, scope_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.diagnosis import Ladder, Step, UnknownStructure

_STEP_WIDTH = 1.35


def plot_ladder(ladder: Ladder, floor: Mapping[str, float] | None = None) -> Figure:
    """Draw the errors of every step of a ladder, and the unknown structure when it ends in one.

    Parameters
    ----------
    floor : mapping of str to float, optional
        NRMSE that the noise of each output alone leaves, by its name.

    Returns
    -------
    matplotlib Figure
        For `idloop.drawing.save`.
    """
    from matplotlib.figure import Figure

    forces = any(_force(step, kind) is not None for step in ladder.steps for kind in ("train", "validation"))
    rows = 1 + forces + (ladder.unknown is not None)
    width = 4.2 + _STEP_WIDTH * len(ladder.steps)
    with drawing.styled():
        figure = Figure(figsize=(width, 2.4 * rows + 1.3), layout="constrained")
        axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
        errors = int(forces and ladder.criterion == "force")  # what the steps were judged by comes first
        _draw_errors(axes[errors], ladder, floor or {})
        if forces:
            _draw_forces(axes[1 - errors], ladder)
            axes[0].set_xticks(np.arange(len(ladder.steps)), [""] * len(ladder.steps))
            # Equal, so that a step stands below itself; the error of the force may end before the ladder does.
            ends = [axes[row].get_xlim() for row in (0, 1)]
            for row in (0, 1):
                axes[row].set_xlim(min(low for low, _ in ends), max(high for _, high in ends))
        _name_steps(axes[int(forces)], ladder)
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


def _draw_errors(axes: Any, ladder: Ladder, floor: Mapping[str, float]) -> None:
    """One colour for each output; what the fit did not see is drawn full, the fitted data dashed."""
    places = np.arange(len(ladder.steps))
    names = list(dict.fromkeys(name for step in ladder.steps for name in step.train.get("nrmse", {})))
    unseen = any(step.validation for step in ladder.steps)
    for index, name in enumerate(names):
        colour = drawing.MODELS[index % len(drawing.MODELS)]
        for kind, look in (("train", (0, (4, 2))), ("validation", "-")):
            values = np.array([_measure(step, kind, "nrmse", name) for step in ladder.steps])
            if np.any(np.isfinite(values)):
                label = f"{name}, {DATA_USE[kind]}" if unseen else name
                axes.plot(places, values, color=colour, linestyle=look, marker="o", markersize=3.5, label=label)
        if np.isfinite(floor.get(name, np.nan)) and floor[name] > 0.0:
            axes.axhline(floor[name], color=colour, linewidth=0.8, linestyle=":", label=f"{name}, noise floor")
    _scale(axes, "NRMSE of the free run [-]")


def _draw_forces(axes: Any, ladder: Ladder) -> None:
    places = np.arange(len(ladder.steps))
    for kind, look in (("train", (0, (4, 2))), ("validation", "-")):
        found = [_force(step, kind) for step in ladder.steps]
        values = np.array([np.nan if value is None else 100.0 * value for value in found])
        if np.any(np.isfinite(values)):
            axes.plot(
                places, values, color=drawing.COMMAND, linestyle=look, marker="o", markersize=3.5, label=DATA_USE[kind]
            )
            shown = values  # of unseen data, where there is any
    for place, value in zip(places, shown, strict=True):
        if np.isfinite(value):
            axes.annotate(f"{value:.3g} %", (place, value), (6, 5), textcoords="offset points", fontsize="small")
    _scale(axes, "force error [%]", decades=False)


def _scale(axes: Any, label: str, *, decades: bool = True) -> None:
    """Decades where the errors span some; the legend beside."""
    from matplotlib.ticker import LogLocator

    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.lines] or [np.zeros(0)])
    positive = values[np.isfinite(values) & (values > 0.0)]
    if decades and len(positive) and np.max(positive) > 5.0 * np.min(positive):
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


def _name_steps(axes: Any, ladder: Ladder) -> None:
    axes.set_xticks(np.arange(len(ladder.steps)), [step_label(step, ladder) for step in ladder.steps])


def step_label(step: Step, ladder: Ladder) -> str:
    """What a step added, its evidence, and in brackets what the data cannot tell it from.

    Parameters
    ----------
    ladder : Ladder
        Of which it is one.

    Returns
    -------
    str
        A few short lines.
    """
    if step.added is None:
        return "start"
    lines = [f"+ {effect_words(step.added.effect)}", f"@ {step.added.at}"]
    if step.chosen_by == "user":
        lines.append("chosen by the user")
    elif step.p_value is not None:
        lines.append(p_text(step.p_value))
    lines += [f"[or {effect_words(name)}]" for name in ladder.rivals(step)]
    return "\n".join(lines)


def _draw_unknown(axes: Any, unknown: UnknownStructure) -> None:
    at, force, band = (np.asarray(v, dtype=float) for v in (unknown.at, unknown.force, unknown.band))
    colour = drawing.MODELS[1]
    axes.axhline(0.0, color=drawing.MEASURED, linewidth=0.6)
    axes.fill_between(at, force - band, force + band, color=drawing.BAND, alpha=0.35, linewidth=0, label="95 % band")
    axes.plot(at, force, color=colour, label="as learnt")
    axes.set_xlabel(drawing.label(unknown.along, unknown.unit))
    axes.set_ylabel(drawing.label(unknown.what, unknown.force_unit))
    axes.set_title(f"explains {100.0 * unknown.share:.0f} % of what is left", loc="left")
    _legend_beside(axes)


def _measure(step: Step, kind: str, measure: str, name: str) -> float:
    value = getattr(step, kind).get(measure, {}).get(name)
    return np.nan if value is None else float(value)


def _force(step: Step, kind: str) -> float | None:
    value = getattr(step, kind).get("force")
    return None if value is None or not np.isfinite(value) else float(value)
