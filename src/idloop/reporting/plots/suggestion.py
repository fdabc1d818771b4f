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

# Inches: the width of a column alone, and of the two of a dense experiment; the height of a row and of a line of words.
_ALONE, _PAIR = 7.9, (7.3, 5.4)
_TALL = {"sent": 1.4, "output": 2.0, "difference": 1.6}
_LINE = 0.17
# More rows than these are less tall.
_MANY, _SMALLER = 6, 0.8
# Letters in an inch of text and of a legend, and those as wide as the line of an entry and the spaces about it.
_TEXT_LETTERS, _LEGEND_LETTERS, _HANDLE = 13, 15, 8
# Turns of a curve that a column alone still shows, and those that the second column shows.
_READABLE, _TURNS_SHOWN = 80, 48
# Shares of the duration that it shows: a chirp turns seldom at one end, and slow outputs need some time.
_LEAST_SHOWN, _MOST_SHOWN = 0.04, 0.33
_FAINT_TURN = 0.02  # of the range of a curve: no eye would see it

_SENT: dict[str, Any] = {"color": drawing.COMMAND, "linewidth": 1.1}
_LIMIT: dict[str, Any] = {"color": drawing.MEASURED, "linewidth": 0.9, "linestyle": (0, (6, 2, 1, 2))}
_BAND: dict[str, Any] = {"facecolor": drawing.BAND, "alpha": 0.4, "edgecolor": drawing.COMMAND, "linewidth": 0.5}


def plot_suggestion(suggestion: Suggestion) -> Figure:
    """Draw the figure of a suggestion with its rivals."""
    from matplotlib.figure import Figure

    rows, duration = rows_of(suggestion), suggestion.experiment.duration
    stretch = _stretch(rows, duration)
    widths = (_ALONE,) if stretch is None else _PAIR
    names = [(rival_name(suggestion, index), str(index)) for index in range(len(suggestion.rivals))]
    title, text = (_wrapped(words, sum(widths)) for words in (_title(suggestion), _text(suggestion)))
    talls = [_TALL[row.kind] * (_SMALLER if len(rows) > _MANY else 1.0) for row in rows]
    height = sum(talls) + _LINE * (len(names) + len(title) + len(text) + 2)
    with drawing.styled(), drawing.short_numbers():
        figure = Figure(figsize=(sum(widths), height), layout="constrained")
        grid = figure.subplots(
            len(rows), len(widths), squeeze=False, gridspec_kw={"width_ratios": widths, "height_ratios": talls}
        )
        figure.supxlabel("\n".join(text), x=0.01, ha="left", fontsize=9.0)
        _add_legend(
            figure, names, sum(widths), loc="outside upper left", alignment="left", borderaxespad=0.8,
            title="\n".join(title), title_fontproperties={"weight": "bold", "size": 10.0},
        )  # fmt: skip
        for row, axes in zip(rows, grid, strict=True):
            _draw(axes[0], row, (0.0, duration), limits=row.limits, dense=stretch is not None)
            axes[0].set_ylabel(row.label)
            if row.entries:
                # Outside the axes: inside, it would lie on the curves somewhere.
                _add_legend(
                    axes[0],
                    row.entries,
                    0.85 * widths[0],
                    borderaxespad=0.0,
                    loc="lower right",
                    bbox_to_anchor=(1.0, 1.01),
                )
            if stretch is not None:
                axes[0].axvspan(*stretch, color=drawing.MODELS[4], alpha=0.25, linewidth=0.0, zorder=0.5)
                _draw(axes[1], row, stretch)
        for axes in grid[:-1].flat:
            axes.tick_params(labelbottom=False)
        for axes in grid[-1]:
            axes.set_xlabel(drawing.label("time", "s"))
        figure.align_ylabels(grid[:, 0])
        if stretch is not None:
            grid[0, 1].set_title(f"where they differ most: {stretch[0]:.3g} .. {stretch[1]:.3g} s", loc="left")
    return figure


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


def _wrapped(text: str, wide: float) -> list[str]:
    """Lines of whole words that fit a width [inches]."""
    wrapper = textwrap.TextWrapper(int(_TEXT_LETTERS * wide), break_on_hyphens=False)
    return [line for paragraph in text.split("\n") for line in wrapper.wrap(paragraph)]


def _stretch(rows: list[Row], duration: float) -> tuple[float, float] | None:
    """Where the rivals differ most, of a length that can be read; None where the whole can be read."""
    turning = [_turns(curve) for row in rows for curve in row.curves if row.kind != "difference"]
    densest = max(turning, key=len)
    if len(densest) <= _READABLE:
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


def _add_legend(place: Axes | Figure, entries: Entries, wide: float, **look: Any) -> None:
    """Signs and words in as many columns, filled one after the other, as fit a width [inches]."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    letters = [len(text) + _HANDLE for text, _ in entries]
    fitting = (
        n for n in range(len(entries), 1, -1) if sum(map(max, np.array_split(letters, n))) <= _LEGEND_LETTERS * wide
    )
    signs: list[Any] = []
    for _, which in entries:
        line = _LIMIT if which == "limit" else _look(int(which)) if which != "band" else {}
        signs.append(Patch(**_BAND) if which == "band" else Line2D([], [], **line))
    place.legend(
        signs, [text for text, _ in entries], ncols=next(fitting, 1), borderpad=0.0,
        handlelength=2.6, columnspacing=1.2, **look,
    )  # fmt: skip
