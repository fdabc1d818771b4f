"""Figure: a suggested experiment, what each rival would show in it, and by how much they differ.

From top to bottom: what is sent in; in a closed loop the command that each rival then needs; for each output the
rivals on one another, and their differences from the first one against the noise. Where the motion is too dense
for the width of a page, a second column shows the stretch in which the rivals differ most.
"""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.arrays import Array
from idloop.reporting.experiment_rows import Curve, Row, reach, rival_name, rows_of, sent_unit
from idloop.reporting.terms import sentence

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from idloop.diagnosis.design.suggest import Suggestion

Entries = list[tuple[str, str]]

# Inches: left of a column for its labels (how far out they are), a column alone, the two of a dense experiment, beside
# and below them.
_LEFT, _LABEL, _ALONE, _PAIR, _RIGHT, _BELOW = 0.95, 0.7, 6.9, (6.2, 4.4), 0.15, 0.6
# Of a row, between rows, of a line of words, above and beside the words of the head.
_TALL = {"sent": 1.15, "output": 1.75, "difference": 1.25}
_GAP, _LINE, _HEAD, _MARGIN = 0.14, 0.17, 0.12, 0.2
# More rows than these are less tall.
_MANY, _SMALLER = 6, 0.8
# Beside the words of an entry of a legend: its line and the spaces about it.
_HANDLE = 0.55
# Points of the letters of the title, the text and the legends; width of a letter as a share of its size.
_TITLE_SIZE, _TEXT_SIZE, _LEGEND_SIZE, _LETTER = 10.0, 9.0, 8.0, 0.6
# Turns of a curve that an inch still shows, and those that the second column shows.
_TURNS_PER_INCH, _TURNS_SHOWN = 12.0, 48
# Shares of the duration that it shows: a chirp turns seldom at one end, and slow outputs need some time.
_LEAST_SHOWN, _MOST_SHOWN = 0.04, 0.33
_FAINT_TURN = 0.02  # of the range of a curve: no eye would see it

_SENT: dict[str, Any] = {"color": drawing.COMMAND, "linewidth": 1.1}
_LIMIT: dict[str, Any] = {"color": drawing.MEASURED, "linewidth": 0.9, "linestyle": (0, (6, 2, 1, 2))}
_BAND: dict[str, Any] = {"facecolor": drawing.BAND, "alpha": 0.4, "edgecolor": drawing.COMMAND, "linewidth": 0.5}


def plot_suggestion(suggestion: Suggestion) -> Figure:
    """Draw the figure of a suggestion with its rivals."""
    rows, duration = rows_of(suggestion), suggestion.experiment.duration
    stretch = _stretch(rows, duration)
    widths = (_ALONE,) if stretch is None else _PAIR
    with drawing.styled(), drawing.short_numbers():
        figure, grid = _new_page(suggestion, rows, widths)
        for row, axes in zip(rows, grid, strict=True):
            _draw(axes[0], row, (0.0, duration), limits=row.limits, dense=stretch is not None)
            axes[0].set_ylabel(row.label)
            if row.entries:
                # Outside the axes: inside, it would lie on the curves somewhere.
                _add_legend(axes[0], row.entries, widths[0], loc="lower right", bbox_to_anchor=(1.0, 1.01))
            if stretch is not None:
                axes[0].axvspan(*stretch, color=drawing.MODELS[4], alpha=0.25, linewidth=0.0, zorder=0.5)
                _draw(axes[1], row, stretch)
        for axes in grid[:-1].flat:
            axes.tick_params(labelbottom=False)
        for axes in grid[-1]:
            axes.set_xlabel(drawing.label("time", "s"))
        if stretch is not None:
            grid[0, 1].set_title(f"where they differ most: {stretch[0]:.3g} .. {stretch[1]:.3g} s", loc="left")
    return figure


def _new_page(suggestion: Suggestion, rows: list[Row], widths: tuple[float, ...]) -> tuple[Figure, Any]:
    """Title, text and legend of the rivals, and axes below, (rows, columns), at fixed places: quickly drawn."""
    from matplotlib.figure import Figure

    width = sum(widths) + _LEFT * len(widths) + _RIGHT
    inside = width - 2.0 * _MARGIN
    title, text = _wrapped(_title(suggestion), inside, _TITLE_SIZE), _wrapped(_text(suggestion), inside, _TEXT_SIZE)
    names = [(rival_name(suggestion, index), str(index)) for index in range(len(suggestion.rivals))]
    below_title = _HEAD + 1.2 * _LINE * len(title)
    below_text = below_title + _LINE * (len(text) + 0.3)
    top = below_text + _LINE * (_legend_lines(names, inside) + 0.3)
    gaps = [_GAP + _LINE * _legend_lines(row.entries, widths[0]) for row in rows]
    talls = [_TALL[row.kind] * (_SMALLER if len(rows) > _MANY else 1.0) for row in rows]
    height = top + sum(gaps) + sum(talls) + _BELOW

    figure = Figure(figsize=(width, height))
    left: dict[str, Any] = {"x": _MARGIN / width, "ha": "left", "va": "top"}
    figure.text(y=1.0 - _HEAD / height, s="\n".join(title), fontsize=_TITLE_SIZE, fontweight="bold", **left)
    figure.text(y=1.0 - below_title / height, s="\n".join(text), fontsize=_TEXT_SIZE, linespacing=1.25, **left)
    corner = (_MARGIN / width, 1.0 - below_text / height)
    _add_legend(figure, names, inside, loc="upper left", bbox_to_anchor=corner)
    grid = np.empty((len(rows), len(widths)), dtype=object)
    for row, (gap, tall) in enumerate(zip(gaps, talls, strict=True)):
        top += gap + tall
        for column, wide in enumerate(widths):
            begin = _LEFT * (column + 1) + sum(widths[:column])
            grid[row, column] = figure.add_axes((begin / width, 1.0 - top / height, wide / width, tall / height))
            grid[row, column].yaxis.set_label_coords(-_LABEL / wide, 0.5)
    return figure, grid


def _title(suggestion: Suggestion) -> str:
    """The experiment and its expected discrimination."""
    from idloop.diagnosis.design.expected_outcome import lead_text

    signal, unit = suggestion.signal, sent_unit(suggestion)
    parts = [f"{signal['name']} on the {suggestion.adds_to}"]
    parts += [f"{key} {signal[key]:.3g} {unit}".rstrip() for key in ("amplitude", "offset") if signal.get(key)]
    # Of many effects that may be there, each is as visible as it is.
    shown = [outcome.in_favour for outcome in suggestion.outcomes[1:]] if suggestion.against_first else []
    expected = [min(shown), max(shown)] if len(shown) > 1 else [suggestion.discrimination]
    numbers = " to ".join(dict.fromkeys(lead_text(value) for value in expected))
    return f"{', '.join(parts)}, {suggestion.duration:.3g} s: expected discrimination {numbers} in log-likelihood"


def _text(suggestion: Suggestion) -> str:
    """What is below the title: paragraphs."""
    text = (
        f"{sentence(suggestion.text)}\n"
        "Curves: the rivals as they are now. Leads: log-likelihood after the others are refitted to this experiment."
    )
    judged = {name for outcome in suggestion.outcomes for errors in outcome.errors.values() for name in errors}
    if judged - set(suggestion.rivals[0][1].output_names):
        text += " What decides is the drive force that stays unexplained."
    return text


def _wrapped(text: str, wide: float, size: float) -> list[str]:
    """Lines of whole words that fit a width [inches] in letters of a size [points]."""
    letters = int(72.0 * wide / (_LETTER * size))
    wrapper = textwrap.TextWrapper(letters, break_on_hyphens=False)
    return [line for paragraph in text.split("\n") for line in wrapper.wrap(paragraph)]


def _stretch(rows: list[Row], duration: float) -> tuple[float, float] | None:
    """Where the rivals differ most, of a length that can be read; None where the whole can be read."""
    turning = [_turns(curve) for row in rows for curve in row.curves if row.kind != "difference"]
    densest = max(turning, key=len)
    if len(densest) <= _TURNS_PER_INCH * _ALONE:
        return None
    # In units of the noise, all outputs and rivals together.
    apart = [(curve, row.band) for row in rows if row.band is not None for curve in row.curves[1:]]
    time = apart[0][0].time
    power = sum(np.nan_to_num(curve.value / band) ** 2 for curve, band in apart)
    reach = max(round(min(_TURNS_SHOWN / len(densest), _MOST_SHOWN) * len(time)), 1)
    total = np.cumsum(np.concatenate([[0.0], power]))
    middle = float(time[min(int(np.argmax(total[reach:] - total[:-reach])) + reach // 2, len(time) - 1)])
    at = int(np.searchsorted(densest, middle))
    low, high = max(at - _TURNS_SHOWN // 2, 0), min(at + _TURNS_SHOWN // 2, len(densest) - 1)
    half = 0.5 * float(np.clip(densest[high] - densest[low], _LEAST_SHOWN * duration, _MOST_SHOWN * duration))
    begin = float(np.clip(middle - half, 0.0, duration - 2.0 * half))
    return begin, begin + 2.0 * half


def _turns(curve: Curve) -> Array:
    """Instants at which a curve visibly turns round [s]."""
    from scipy.signal import find_peaks

    low, high = reach([curve])
    least = max(_FAINT_TURN * (high - low), 1e-300)
    turns = [find_peaks(sign * curve.value, prominence=least)[0] for sign in (1.0, -1.0)]
    return np.asarray(curve.time[np.sort(np.concatenate(turns))])


def _look(index: int) -> dict[str, Any]:
    """The first rival is wide and below, so that one that agrees with it is seen on it."""
    return {**drawing.model_look(index), "linewidth": 2.2 if index == 0 else 1.1, "alpha": 0.6 if index == 0 else 1.0}


def _draw(
    axes: Axes, row: Row, stretch: tuple[float, float], *, limits: tuple[float, ...] = (), dense: bool = False
) -> None:
    """Curves, limits and band of a row in a stretch of time; `limits` are kept in view."""
    for limit in row.limits:
        axes.axhline(limit, **_LIMIT)
    if row.band is not None:
        axes.axhspan(-row.band, row.band, **_BAND)
    for index, curve in enumerate(row.curves):
        look = _SENT if curve.rival is None else _look(curve.rival)
        if row.kind == "difference" and index == 0:  # the zero: the band must stay visible on it
            look = {**look, "linewidth": 1.0}
        if dense:  # dashes and widths are lost
            look = {**look, "linewidth": 0.7, "linestyle": "-", "alpha": 0.8}
        (drawing.steps if curve.held else drawing.line)(axes, curve.time, curve.value, **look)
    low, high = reach(row.curves, stretch)
    if row.band is not None:
        low, high = min(low, -1.3 * row.band), max(high, 1.3 * row.band)
    low, high = min((low, *limits)), max((high, *limits))
    room = 0.06 * (high - low) or max(0.1 * abs(high), 1e-3)
    axes.set(xlim=stretch, ylim=(low - room, high + room))


def _legend_columns(entries: Entries, wide: float) -> int:
    """Columns of a legend, filled one after the other, that fit a width [inches]."""
    widths = [len(text) * _LETTER * _LEGEND_SIZE / 72.0 + _HANDLE for text, _ in entries]
    fitting = (n for n in range(len(entries), 1, -1) if sum(map(max, np.array_split(widths, n))) <= wide)
    return next(fitting, 1)


def _legend_lines(entries: Entries, wide: float) -> int:
    return -(-len(entries) // _legend_columns(entries, wide))


def _add_legend(place: Axes | Figure, entries: Entries, wide: float, **where: Any) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    signs: list[Any] = []
    for _, which in entries:
        look = _LIMIT if which == "limit" else _look(int(which)) if which != "band" else {}
        signs.append(Patch(**_BAND) if which == "band" else Line2D([], [], **look))
    place.legend(
        signs, [text for text, _ in entries], ncols=_legend_columns(entries, wide), borderaxespad=0.0, borderpad=0.0,
        handlelength=2.6, columnspacing=1.2, fontsize=_LEGEND_SIZE, **where,
    )  # fmt: skip
