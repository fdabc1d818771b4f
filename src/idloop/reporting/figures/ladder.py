"""The ladder: one row for each step, its error from left to right with the way from that of the step before.

Steps stand below one another, so that their names are whole words on a phone as well, and nothing is drawn across them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.models import FixedTicker, HoverTool, Range1d
from bokeh.models.annotations import Label
from bokeh.plotting import figure

from idloop.arrays import Array
from idloop.reporting.figures.theme import FONT, LIGHT, Theme, add_legend, new_figure, source
from idloop.reporting.scores import TRAIN, ErrorLine, error_lines, force_lines, in_decades, step_evidence, step_title
from idloop.reporting.terms import effect_words

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder, Step


# Height of a row with its words [CSS pixels].
ROW = 48
# Lines of a row stand below one another, this part of a row apart.
_APART = 0.12
# Room below the last row, in rows.
_BELOW = 0.4
# Over so many decades more than one tick in each is too much for a phone.
_MANY = 2.5


def step_names(ladder: Ladder) -> list[str]:
    """What each step added, in words, with its number so that no two are equal."""
    return [f"{number}  {step_title(step)}" for number, step in enumerate(ladder.steps)]


def ladder_figures(ladder: Ladder, floor: Mapping[str, float] | None = None, theme: Theme = LIGHT) -> list[figure]:
    """Draw the error of every step.

    `floor`: NRMSE that the noise of each output alone leaves.
    Returns: the drive force [%] where it is known, and the outputs; first what the steps were judged by.
    """
    plots = []
    forces, outputs = force_lines(ladder), error_lines(ladder)
    if forces:
        alone = f", {forces[0].use} data" if len(forces) == 1 and forces[0].use else ""  # it has no legend
        plots.append(_draw(ladder, forces, (f"error of the drive force{alone}", "%"), {}, theme))
    if outputs:
        floors = {line.colour: f for line in outputs if (f := (floor or {}).get(line.quantity, np.nan)) > 0.0}
        plots.append(_draw(ladder, outputs, ("NRMSE of the free run", "-"), floors, theme))
    # What the steps were judged by comes first.
    return plots if ladder.criterion == "force" else plots[::-1]


def _draw(
    ladder: Ladder, lines: list[ErrorLine], x: tuple[str, str], floors: Mapping[int, float], theme: Theme
) -> figure:
    names = step_names(ladder)
    values = np.concatenate([line.error for line in lines] + [np.array(list(floors.values()))])
    values = values[np.isfinite(values) & (values > 0.0)]
    low, high = (float(np.min(values)), float(np.max(values))) if len(values) else (0.1, 1.0)
    decades = in_decades(values)
    # Room for the marks of the last row's last line.
    below = max(_BELOW, _APART * (len(lines) - 1) + 0.17)
    plot = new_figure(
        theme, x, ("", None),
        x_axis_type="log" if decades else "linear",
        x_range=Range1d(start=0.8 * low, end=1.3 * high) if decades else Range1d(start=0.0, end=1.12 * high),
        height=70 + round(ROW * (len(names) + below - _BELOW)), tools="reset,save", active_drag=None,
    )  # fmt: skip
    if decades:
        number_decades(plot, 0.8 * low, 1.3 * high)
    places = name_rows(plot, names, theme, below)
    entries = []
    for number, line in enumerate(lines):
        colour = theme.models[line.colour % len(theme.models)]
        # As in every figure of a ladder with unseen data, also where nothing is known of those here.
        faint = line.kind == TRAIN and bool(line.use)
        error = np.where(line.error > 0.0, line.error, np.nan)
        columns = source(
            x=error, before=np.concatenate([[np.nan], error[:-1]]), y=places - _APART * number, name=names,
            evidence=[_evidence(step, ladder) for step in ladder.steps], what=[line.label] * len(names),
        )  # fmt: skip
        fill = theme.surface if faint else colour
        way: dict[str, Any] = {"color": colour, "line_width": 1.6, "line_dash": [6, 4] if faint else "solid"}
        drawn = [
            plot.segment("before", "y", "x", "y", source=columns, **way),
            plot.scatter("x", "y", source=columns, size=9, line_color=colour, fill_color=fill),
        ]
        entries.append((line.label, drawn))
    for index, value in floors.items():
        colour = theme.models[index % len(theme.models)]
        look: dict[str, Any] = {"color": colour, "line_dash": [2, 3], "line_width": 1.6}
        floor = source(x=np.full(len(places), value), low=places - _APART * len(lines), high=places + _APART)
        name = next(line.quantity for line in lines if line.colour == index)
        entries.append((f"{name}, noise floor", [plot.segment("x", "low", "x", "high", source=floor, **look)]))
    plot.add_tools(HoverTool(tooltips=[("step", "@name"), ("@what", f"@x {x[1]}"), ("", "@evidence")]))
    if len(entries) > 1:
        add_legend(plot, theme, entries)
    return plot


def decade_ticks(low: float, high: float) -> list[float]:
    """Round numbers for an axis between two positive ends: 1, 2, 5, 10, ..., or whole decades where there are many."""
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    steps = (1, 2, 5) if np.log10(high / low) < _MANY else (1,)
    return [tick for n in range(first, last + 1) for step in steps if low <= (tick := float(f"{step}e{n}")) <= high]


def number_decades(plot: figure, low: float, high: float) -> None:
    """Number the horizontal axis of decades with whole numbers that leave each other room on a phone."""
    ticks = decade_ticks(low, high)
    plot.xaxis.ticker = FixedTicker(ticks=ticks)
    plot.xaxis.major_label_overrides = {tick: f"{tick:g}" for tick in ticks}


def name_rows(plot: figure, names: Sequence[str], theme: Theme, below: float = _BELOW) -> Array:
    """Lay out rows below one another, each with its words above what is drawn: they stay whole on a phone.

    `plot`: its vertical axis is hidden.
    `below`: room below the last row, in rows.
    Returns shape (rows,): height at which each row is drawn; rows are 1 apart.
    """
    plot.yaxis.visible = False
    plot.ygrid.visible = False
    plot.min_border_left = 14
    places = -np.arange(len(names), dtype=float)
    plot.y_range = Range1d(start=1.0 - below - len(names), end=0.85)
    for name, place in zip(names, places, strict=True):
        plot.add_layout(
            Label(
                x=0, x_units="screen", y=place, y_offset=9, text=name, text_color=theme.text, text_font=FONT,
                text_font_size="12px", background_fill_color=theme.surface,
            )
        )  # fmt: skip
    return places


def _evidence(step: Step, ladder: Ladder) -> str:
    if step.added is None:
        return "the model as it was given, fitted"
    others = [effect_words(name) for name in ladder.rivals(step)]
    tie = f"; not distinguishable from {', '.join(others)}" if others and step.chosen_by != "user" else ""
    return step_evidence(step) + tie
