"""Evidence over the samples that were scored: one line for each effect, the threshold, a mark where one is decided.

It has no legend: a table beside it has the key of each line with its newest value. BokehJS builds every entry of a
legend anew, with a canvas each, for every line that has become longer: 130 canvases a second for six of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from bokeh.models import HoverTool
from bokeh.models.annotations import Span
from bokeh.plotting import figure

from idloop.reporting.figures.theme import LIGHT, Theme, new_figure, padded, source
from idloop.reporting.terms import effect_words

# Lines that are drawn: those with most evidence.
MOST = 6
MARKS = ("circle", "square", "triangle", "diamond", "inverted_triangle", "hex")


@dataclass(frozen=True)
class Decided:
    """Where the evidence for an effect reached the threshold."""

    seconds: float  # new samples that had been scored [s]
    samples: int
    log_e: float


def drawn_lines(lines: Mapping[str, Sequence[float]], decided: Mapping[str, Decided]) -> dict[str, int]:
    """Number of the look of each line that is drawn, by effect; a line keeps it while others come."""
    newest = {name: values[-1] for name, values in lines.items() if len(values)}
    shown = sorted(newest, key=lambda name: (name not in decided, -newest[name]))[:MOST]
    return {name: index for index, name in enumerate(name for name in lines if name in shown)}


def evidence_figure(
    seconds: Sequence[float],
    lines: Mapping[str, Sequence[float]],
    threshold: float,
    decided: Mapping[str, Decided],
    theme: Theme = LIGHT,
    *,
    recorded: bool = False,
) -> figure:
    """Draw how the evidence grows.

    `seconds` (looks,): new samples that had been scored at each look [s].
    `lines` (looks,): log-evidence by effect; NaN before an effect was weighed.
    `threshold`: log-evidence that decides.
    `recorded`: of a recording, not of new samples.
    """
    scored = "samples scored" if recorded else "new samples"
    shown = drawn_lines(lines, decided)
    values = [value for name in shown for value in lines[name] if np.isfinite(value)]
    marks = [decided[name] for name in shown if name in decided]
    values += [threshold, 0.0, *(one.log_e for one in marks)]
    plot = new_figure(
        theme, (scored, "s"), ("log E", "-"),
        y_range=padded(min(values), max(values)), x_range=padded(0.0, max([1.0, *seconds])),
    )  # fmt: skip
    for name, index in shown.items():
        look, mark = theme.model(index), MARKS[index % len(MARKS)]
        columns = source(x=list(seconds), y=list(lines[name]), name=[effect_words(name)] * len(seconds))
        plot.line("x", "y", source=columns, line_width=2, **look)
        plot.scatter("x", "y", source=columns, size=4, marker=mark, color=look["color"], name="looks")
        if name in decided:
            one = decided[name]
            at = source(x=[one.seconds], y=[one.log_e], samples=[one.samples], name=[effect_words(name)])
            plot.scatter(
                "x", "y", source=at, size=13, marker=mark, line_color=theme.found, line_width=3,
                fill_color=theme.surface, name="decided",
            )  # fmt: skip
    look = {"line_color": theme.limit, "line_dash": [6, 4], "line_width": 1.6}
    plot.add_layout(Span(location=threshold, dimension="width", **look))
    for kind, last in (("looks", ("log E", "@y{0.0}")), ("decided", ("decided after", "@samples samples"))):
        found: Any = [one for one in plot.renderers if one.name == kind]
        plot.add_tools(HoverTool(renderers=found, tooltips=[("", "@name"), (scored, "@x{0.0} s"), last]))
    return plot
