"""What is missing: the effects that were added, those that tie with them, what was weighed and what cannot be shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from bokeh.models import HoverTool, Range1d
from bokeh.plotting import figure

from idloop.p_values import p_text
from idloop.reporting.detectability import undetectable
from idloop.reporting.figures.ladder import ROW, name_rows
from idloop.reporting.figures.theme import LIGHT, Theme, new_figure, source
from idloop.reporting.terms import effect_words

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate, Ladder

ADDED, TIED, WEIGHED, UNTESTABLE = "added", "tied", "weighed", "untestable"
STANDINGS = {
    ADDED: "added",
    TIED: "as likely",
    WEIGHED: "not added",
    UNTESTABLE: "this data cannot show it",
}


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
        if step.added is None:
            continue
        p_value = np.nan if step.p_value is None else step.p_value
        # What the step gained is not in its document: a ladder that is read looks like the one that was written.
        rows.append(replace(_row(step.added, ADDED, p_value), gain=np.nan))
        rows += [
            # It fits the data as well as the one that was added, and explains as much.
            EffectRow(name, TIED, _explains(step.added), np.nan, np.nan, _text(known.get(name)), step.added.name)
            for name in ladder.rivals(step)
        ]
    named = {row.name for row in rows}
    untestable = [name for name in undetectable(ladder) if name not in named]
    weighed = [c for c in ladder.candidates if c.name not in {*named, *untestable} and np.isfinite(c.gain)]
    rows += [_row(c, WEIGHED, c.p_value) for c in sorted(weighed, key=lambda c: c.p_value)]
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
    plot.add_tools(
        HoverTool(
            renderers=[bars],
            tooltips=[("", "@name: @text"), ("", "@evidence"), ("log-likelihood gained", "@gain")],
        )
    )
    return plot


def _standing(row: EffectRow) -> str:
    """As few words as a phone has room for."""
    if row.standing == TIED:
        return f"ties with {effect_words(row.tied_with).partition(' @ ')[0]}"
    return p_text(row.p_value) if row.standing == WEIGHED else STANDINGS[row.standing]


def _share_text(row: EffectRow) -> str:
    about = "about " if row.standing == TIED else ""
    return f"{about}{100.0 * row.explains:.0f} %, " if np.isfinite(row.explains) and row.explains >= 5e-3 else ""


def _row(candidate: Candidate, standing: str, p_value: float) -> EffectRow:
    return EffectRow(candidate.name, standing, _explains(candidate), p_value, candidate.gain, candidate.text)


def _explains(candidate: Candidate) -> float:
    fitted = bool(candidate.parameters) or np.isfinite(candidate.gain)
    return candidate.explains if fitted else np.nan


def _text(candidate: Candidate | None) -> str:
    return "" if candidate is None else candidate.text
