"""Effects: what was added, ties and was weighed by the share it explains, and how the evidence for it grows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.models import HoverTool, Range1d
from bokeh.models.annotations import Span
from bokeh.plotting import figure

from idloop.p_values import p_text
from idloop.reporting.figures.ladder import ROW, name_rows
from idloop.reporting.figures.theme import LIGHT, Theme, new_figure, padded, source
from idloop.reporting.terms import effect_words
from idloop.reporting.verdicts import undetectable

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Ladder


ADDED, TIED, WEIGHED, UNTESTABLE = "added", "tied", "weighed", "untestable"
STANDINGS = {ADDED: "added", TIED: "as likely", WEIGHED: "not added", UNTESTABLE: "this data cannot show it"}


@dataclass(frozen=True)
class EffectRow:
    """One effect and its standing."""

    name: str  # ``effect@site``
    standing: str  # of `STANDINGS`; tied: this data cannot distinguish it from `tied_with`
    explains: float  # share of the error's power that it takes away, 0 to 1; NaN where it was not fitted
    p_value: float  # NaN where there is none
    gain: float  # log-likelihood gained; NaN where it was not fitted
    text: str  # the effect in one sentence of physics, or why it cannot be shown
    tied_with: str = ""  # empty but for tied effects

    @property
    def evidence(self) -> str:
        """Its standing in a few words."""
        if self.standing == TIED:
            return f"as likely as {effect_words(self.tied_with)}"
        if self.standing == UNTESTABLE or not np.isfinite(self.p_value):
            return STANDINGS[self.standing]
        return f"{STANDINGS[self.standing]}, {p_text(self.p_value)}"


def ladder_rows(ladder: Ladder) -> list[EffectRow]:
    """Effects of a ladder: what was added with its ties, what was weighed last, what this data cannot show.

    Returns: each effect once.
    """
    known = {c.name: c for c in ladder.candidates}
    rows: list[EffectRow] = []
    for step in ladder.steps:
        added = step.added
        if added is None:
            continue
        p_value = np.nan if step.p_value is None else step.p_value
        # What the step gained is not in its document: a ladder that is read looks like the one that was written.
        rows.append(EffectRow(added.name, ADDED, _explains(added), p_value, np.nan, added.text))
        for name in ladder.rivals(step):
            text = known[name].text if name in known else ""
            # It fits the data as well as the one that was added, and explains as much.
            rows.append(EffectRow(name, TIED, _explains(added), np.nan, np.nan, text, added.name))
    named = {row.name for row in rows}
    untestable = [name for name in undetectable(ladder) if name not in named]
    weighed = [c for c in ladder.candidates if c.name not in {*named, *untestable} and np.isfinite(c.gain)]
    rows += [
        EffectRow(one.name, WEIGHED, _explains(one), one.p_value, one.gain, one.text)
        for one in sorted(weighed, key=lambda one: one.p_value)
    ]
    why = {name: known[name].why if name in known else "" for name in untestable}
    return [*rows, *(EffectRow(name, UNTESTABLE, np.nan, np.nan, np.nan, why[name]) for name in untestable)]


def candidates_figure(rows: Sequence[EffectRow], theme: Theme = LIGHT, *, most: int = 12) -> figure | None:
    """Draw the share of the error that each effect explains, ranked, with its standing in words.

    `most`: at most so many; effects that this data cannot show are left to a list.
    Returns: None without any effect.
    """
    drawn = [row for row in rows if row.standing != UNTESTABLE][:most]
    if not drawn:
        return None
    names = [effect_words(row.name) for row in drawn]
    share = np.array([100.0 * row.explains for row in drawn])
    most_share = max(float(np.nanmax(share)) if np.any(np.isfinite(share)) else 0.0, 1.0)
    plot = new_figure(
        theme, ("explained share of the error power", "%"), ("", None),
        x_range=Range1d(start=0.0, end=1.04 * most_share), height=60 + ROW * len(names), tools="reset,save",
        active_drag=None,
    )  # fmt: skip
    labels = [f"{name}: {_share_text(row)}{_standing(row)}" for name, row in zip(names, drawn, strict=True)]
    places = name_rows(plot, labels, theme)
    colours = {ADDED: theme.found, TIED: theme.found, WEIGHED: theme.band}
    columns = source(
        name=names, y=places, share=np.nan_to_num(share), colour=[colours[row.standing] for row in drawn],
        evidence=[row.evidence for row in drawn], text=[row.text for row in drawn],
        gain=[f"{row.gain:.4g}" if np.isfinite(row.gain) else "-" for row in drawn],
    )  # fmt: skip
    bars = plot.hbar(
        y="y", right="share", height=0.3, source=columns, fill_color="colour", line_color="colour", fill_alpha=0.9
    )
    tips = [("", "@name: @text"), ("", "@evidence"), ("log-likelihood gained", "@gain")]
    plot.add_tools(HoverTool(renderers=[bars], tooltips=tips))
    return plot


def _standing(row: EffectRow) -> str:
    """As few words as a phone has room for."""
    if row.standing == TIED:
        return f"ties with {effect_words(row.tied_with).partition(' @ ')[0]}"
    return p_text(row.p_value) if row.standing == WEIGHED else STANDINGS[row.standing]


def _share_text(row: EffectRow) -> str:
    about = "about " if row.standing == TIED else ""
    return f"{about}{100.0 * row.explains:.0f} %, " if np.isfinite(row.explains) and row.explains >= 5e-3 else ""


def _explains(candidate: Candidate) -> float:
    fitted = bool(candidate.parameters) or np.isfinite(candidate.gain)
    return candidate.explains if fitted else np.nan


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
    """Draw how the evidence grows: a line for each effect, the threshold, a mark where one is decided.

    It has no legend: a table beside it has the key of each line with its newest value. BokehJS builds every entry of a
    legend anew, with a canvas each, for every line that has become longer: 130 canvases a second for six of them.

    `seconds` (looks,): new samples that had been scored at each look [s]. `lines` (looks,): log-evidence by effect; NaN
    before an effect was weighed. `threshold`: log-evidence that decides. `recorded`: not of new samples.
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
