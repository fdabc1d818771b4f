"""The ladder: one line of the figure for each step, its error from left to right, the noise floor at the left.

Steps stand below one another, so that their names are whole words on a phone as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.models import FixedTicker, HoverTool, Range1d
from bokeh.models.annotations import Label, Span
from bokeh.plotting import figure
from numpy.typing import NDArray

from idloop.reporting.figures.theme import FONT, LIGHT, Theme, add_legend, new_figure, source
from idloop.reporting.terms import DATA_USE, effect_words, p_text

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder, Step

Array = NDArray[np.float64]

# Height of a row with its words [CSS pixels].
ROW = 44
TRAIN, VALIDATION = "train", "validation"
# From this ratio of the largest to the smallest error on, decades are read better.
_DECADES = 5.0
# Over so many decades more than one tick in each is too much for a phone.
_MANY = 2.5


@dataclass(frozen=True)
class ErrorLine:
    """Error of one quantity at every step.

    Attributes
    ----------
    label : str
        For the legend.
    colour : int
        Number of the quantity; train and validation of one have the same.
    error : array, shape (steps,)
        NaN where not known.
    """

    label: str
    kind: str
    colour: int
    error: Array


def step_names(ladder: Ladder) -> list[str]:
    """What each step added, in words, with its number so that no two are equal."""
    return [
        f"{number}  " + ("start" if step.added is None else f"+ {effect_words(step.added.name)}")
        for number, step in enumerate(ladder.steps)
    ]


def error_lines(ladder: Ladder) -> list[ErrorLine]:
    """NRMSE of the free run of every output at every step.

    Returns
    -------
    list of ErrorLine
        Those of the validation records first; no line for what is nowhere known.
    """
    names = list(dict.fromkeys(name for step in ladder.steps for name in step.train.get("nrmse", {})))
    return _lines(ladder, {name: (lambda part, name=name: part.get("nrmse", {}).get(name)) for name in names})


def force_lines(ladder: Ladder) -> list[ErrorLine]:
    """Relative error of the drive force [%] at every step."""
    lines = _lines(ladder, {"drive force": lambda part: part.get("force")})
    return [ErrorLine(line.label, line.kind, line.colour, 100.0 * line.error) for line in lines]


def ladder_figures(ladder: Ladder, floor: Mapping[str, float] | None = None, theme: Theme = LIGHT) -> list[figure]:
    """Draw the error of every step.

    Parameters
    ----------
    floor : mapping of str to float, optional
        NRMSE that the noise of each output alone leaves.

    Returns
    -------
    list of figure
        The drive force [%] where it is known, then the outputs; the more telling one first.
    """
    plots = []
    forces, outputs = force_lines(ladder), error_lines(ladder)
    if forces:
        plots.append(_draw(ladder, forces, ("error of the drive force", "%"), {}, theme))
    if outputs:
        floors = {line.colour: f for line in outputs if (f := (floor or {}).get(_output(line.label), np.nan)) > 0.0}
        plots.append(_draw(ladder, outputs, ("NRMSE of the free run", "-"), floors, theme))
    return plots


def _output(label: str) -> str:
    return label.partition(",")[0]


def _lines(ladder: Ladder, quantities: Mapping[str, object]) -> list[ErrorLine]:
    unseen = any(step.validation for step in ladder.steps)
    found = []
    for kind in (VALIDATION, TRAIN):
        for colour, (name, read) in enumerate(quantities.items()):
            error = np.array([_number(read(getattr(step, kind))) for step in ladder.steps])  # type: ignore[operator]
            if np.any(np.isfinite(error)):
                found.append(ErrorLine(f"{name}, {DATA_USE[kind]} data" if unseen else name, kind, colour, error))
    return found


def _number(value: float | None) -> float:
    return np.nan if value is None else float(value)


def _draw(
    ladder: Ladder, lines: list[ErrorLine], x: tuple[str, str], floors: Mapping[int, float], theme: Theme
) -> figure:
    names = step_names(ladder)
    values = np.concatenate([line.error for line in lines] + [np.array(list(floors.values()))])
    values = values[np.isfinite(values) & (values > 0.0)]
    low, high = (float(np.min(values)), float(np.max(values))) if len(values) else (0.1, 1.0)
    decades = high > _DECADES * low
    plot = new_figure(
        theme, x, ("", None),
        x_axis_type="log" if decades else "linear",
        x_range=Range1d(start=0.8 * low, end=1.3 * high) if decades else Range1d(start=0.0, end=1.12 * high),
        height=70 + ROW * len(names), tools="reset,save", active_drag=None,
    )  # fmt: skip
    if decades:
        ticks = decade_ticks(0.8 * low, 1.3 * high)
        plot.xaxis.ticker = FixedTicker(ticks=ticks)
        plot.xaxis.major_label_overrides = {tick: f"{tick:g}" for tick in ticks}
    places = name_rows(plot, names, theme)
    entries = []
    unseen = any(line.kind == VALIDATION for line in lines)
    for line in lines:
        colour = theme.models[line.colour % len(theme.models)]
        faint = line.kind == TRAIN and unseen
        told = source(
            x=np.where(line.error > 0.0, line.error, np.nan), y=places, name=names,
            evidence=[_evidence(step, ladder) for step in ladder.steps], what=[line.label] * len(names),
        )  # fmt: skip
        fill = theme.surface if faint else colour
        drawn = [
            plot.line("x", "y", source=told, color=colour, line_width=1.6, line_dash=[6, 4] if faint else "solid"),
            plot.scatter("x", "y", source=told, size=9, line_color=colour, fill_color=fill),
        ]
        entries.append((line.label, drawn))
    for index, value in floors.items():
        colour = theme.models[index % len(theme.models)]
        look: dict[str, Any] = {"line_color": colour, "line_dash": [2, 3], "line_width": 1.6}
        plot.add_layout(Span(location=value, dimension="height", **look))
        name = _output(next(line.label for line in lines if line.colour == index))
        entries.append((f"{name}, what its noise alone leaves", [plot.line([np.nan], [np.nan], **look)]))
    plot.add_tools(HoverTool(tooltips=[("step", "@name"), ("@what", f"@x {x[1]}"), ("", "@evidence")]))
    if len(entries) > 1:
        add_legend(plot, theme, entries)
    return plot


def decade_ticks(low: float, high: float) -> list[float]:
    """Round numbers for an axis of decades: 1, 2, 5, 10, ..., or whole decades where there are many.

    Parameters
    ----------
    low, high : float
        Ends of the axis, both positive.
    """
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    steps = (1, 2, 5) if np.log10(high / low) < _MANY else (1,)
    return [tick for n in range(first, last + 1) for step in steps if low <= (tick := float(f"{step}e{n}")) <= high]


def name_rows(plot: figure, names: Sequence[str], theme: Theme) -> Array:
    """Lay out rows below one another, each with its words above what is drawn: they stay whole on a phone.

    Parameters
    ----------
    plot : figure
        Its vertical axis is hidden.

    Returns
    -------
    array, shape (rows,)
        Height at which each row is drawn; rows are 1 apart.
    """
    plot.yaxis.visible = False
    plot.ygrid.visible = False
    plot.min_border_left = 14
    places = -np.arange(len(names), dtype=float)
    plot.y_range = Range1d(start=0.6 - len(names), end=0.85)
    for name, place in zip(names, places, strict=True):
        plot.add_layout(
            Label(
                x=0, x_units="screen", y=place, y_offset=9, text=name, text_color=theme.text, text_font=FONT,
                # Solid: a line from step to step goes behind the words.
                text_font_size="12px", background_fill_color=theme.surface, background_fill_alpha=1.0,
                level="overlay",
            )
        )  # fmt: skip
    return places


def _evidence(step: Step, ladder: Ladder) -> str:
    if step.added is None:
        return "the model as it was given, fitted"
    if step.chosen_by == "user":
        return "chosen by the user"
    others = [effect_words(name) for name in ladder.rivals(step)]
    tie = f"; cannot be told from {', '.join(others)}" if others else ""
    return (p_text(step.p_value) if step.p_value is not None else "") + tie
