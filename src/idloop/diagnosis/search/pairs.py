"""Effects that are significant only together, because each masks the other.

Two effects may leave opposite traces: dry friction together with quadratic drag hardly shows beside viscous friction,
while each of them alone would. Where no single effect is significant, pairs with similar traces are screened by the
score statistic of both traces, as far as each masks a part of the other, and the best few are fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.options import Progress
from idloop.diagnosis.screening.proposals import Proposal, proposals
from idloop.diagnosis.screening.score_test import Screen, Screened, Trace
from idloop.diagnosis.search.confirm import Confirmed, first_round, points, search, starts
from idloop.errors import IdloopError
from idloop.physics.trial import Trial

Array = NDArray[np.float64]
Traced = tuple[Proposal, Trace]

# Most traces; all pairs of them are screened.
MOST_TRACES = 150


class Scored(NamedTuple):
    """Places of two traces, and the statistic of both together, not yet corrected for heteroscedasticity."""

    first: int
    second: int
    statistic: float


class Pairs:
    """Traces of one direction that can be paired: shapes of effects that have a weak form.

    `alike`, shape (m, m), are the correlations of the traces, to a few per cent of what they leave to 1; `allowed` says
    which pairs are tested, above the diagonal.
    """

    def __init__(self, screened: Sequence[Screened]) -> None:
        groups = []
        for s in screened:
            # An effect without parameters has no weak form.
            traces = [t for t in s.traces if len(t.scores) == len(t.trials) == 1]
            if traces and s.proposal.effect.parameters:
                groups.append([(s.proposal, trace) for trace in _shapes(traces)])
        # The same number of shapes for every effect.
        most = max((len(g) for g in groups), default=0)
        while most > 1 and sum(min(len(g), most) for g in groups) > MOST_TRACES:
            most -= 1
        self.traces = [member for g in groups for member in g[:most]]
        columns = _columns([t for _, t in self.traces])
        self.alike = np.clip(columns.T @ columns, -1.0, 1.0)
        self._sided = np.array([p.one_sided for p, _ in self.traces], dtype=bool)
        close = np.abs(self.alike)
        # Nearly parallel traces are one effect; nearly orthogonal ones mask nothing.
        self.allowed = np.triu((close > 0.1) & (close < 0.98), 1)
        # Two one-sided effects mask each other where their traces are opposite.
        self.allowed &= ~(self._sided[:, None] & self._sided[None, :] & (self.alike > 0.0))
        for i, j in np.argwhere(self.allowed):
            self.allowed[i, j] = _compatible(self.traces[i][0], self.traces[j][0])

    def ranked(self) -> list[Scored]:
        """The best shapes of every two effects that mask each other, best first.

        [s₁ s₂] G⁻¹ [s₁ s₂]ᵀ with the correlation matrix G, of errors along the traces in their standard deviation. The
        joint trace is corrected for heteroscedasticity.
        """
        scores = np.array([t.scores[0] for _, t in self.traces])
        best: dict[tuple[str, str], Scored] = {}
        for first, second in np.argwhere(self.allowed):
            one, other, alike = scores[first], scores[second], self.alike[first, second]
            left, right = one - alike * other, other - alike * one
            wrong_sign = (self._sided[first] and left <= 0.0) or (self._sided[second] and right <= 0.0)
            if wrong_sign or not alike * left * right < 0.0:
                continue
            value = float((one * left + other * right) / (1.0 - alike * alike))
            names = self.traces[first][0].name, self.traces[second][0].name
            if value > 0.0 and (names not in best or value > best[names].statistic):
                best[names] = Scored(int(first), int(second), value)
        return sorted(best.values(), key=lambda s: -s.statistic)


def confirmed_pairs(screen: Screen, screened: Sequence[Screened], bar: float, report: Progress) -> list[Confirmed]:
    """Refit the parent with both effects of the pairs that promise most.

    Each of the two must gain `bar`, as a single effect, beside the other one.
    """
    chosen = [
        (f"{first[0].name} and {second[0].name}", partial(_confirm, screen, first, second, trace))
        for first, second, trace in _promising(screen, screened, bar)
    ]
    return search(screen.estimation, screen.parent, chosen, report)


def _promising(screen: Screen, screened: Sequence[Screened], bar: float) -> list[tuple[Traced, Traced, Trace]]:
    """The few pairs that are promising by a score test of the traces, chosen by their sketches, best first.

    The effect that does more comes first, then the other one, then the trace of both with the size of each.
    """
    pairs, alone = Pairs(screened), {s.proposal.name: s.statistic for s in screened}
    found = []
    for scored in pairs.ranked()[:24]:
        if scored.statistic < 2.0 * bar:
            break
        one, other = pairs.traces[scored.first], pairs.traces[scored.second]
        trace = screen.joint((one[0], one[1].trials[0]), (other[0], other[1].trials[0]))
        if trace is None or trace.statistic - max(alone[one[0].name], alone[other[0].name]) < bar:
            continue
        done = np.abs(trace.size) * np.sqrt([one[1].detectable, other[1].detectable])
        if done[1] > done[0]:
            one, other = other, one
            trace = replace(trace, trials=trace.trials[::-1], size=trace.size[::-1])
        found.append((one, other, trace))
    return sorted(found, key=lambda one: -one[2].statistic)[:8]


def _confirm(screen: Screen, first: Traced, second: Traced, joint: Trace) -> Confirmed | None:
    """The first round of a search for both effects."""
    tops = []
    for place in (-1, 0):
        # The last start has the size of the joint solution, the first one that of the trial.
        one, other = (
            starts(proposal, replace(trace, size=joint.size[i : i + 1]))[place]
            for i, (proposal, trace) in enumerate((first, second))
        )
        tops.append((_beside_first(first[0], one, second[0], screen), other))
    top = tops[0][0]
    if top is None:
        return None
    parent, models = screen.parent, [one.model(values) for one, values in tops if one is not None]
    thetas = [theta for start in models for theta in points(parent, start, joint.shift)]
    fit = first_round(screen.estimation, models[0], thetas, parent)
    return None if fit is None else Confirmed(top, fit, 0.0, joint.statistic, first[0]).refitted(fit, parent)


def _beside_first(first: Proposal, values: Trial, second: Proposal, screen: Screen) -> Proposal | None:
    """The second effect, proposed for the model that has the first; None where they exclude each other."""
    try:
        found = proposals(first.model(values), [second.name], screen.estimation.conditions)
    except IdloopError:
        return None
    return next((p for p in found if p.name == second.name and p.replaces == second.replaces), None)


def _columns(traces: Sequence[Trace]) -> Array:
    """Sketched directions beside each other, one column for each trace."""
    found = [t.direction for t in traces if t.direction is not None]
    return np.column_stack(found) if found else np.zeros((1, 0))


def _shapes(traces: Sequence[Trace]) -> list[Trace]:
    """Traces of one effect that differ, the most different ones first."""
    directions = _columns(traces)
    alike = np.abs(directions.T @ directions)
    kept = [0]
    while len(kept) < len(traces):
        nearest = np.max(alike[kept], axis=0)
        further = int(np.argmin(nearest))
        # Sketches preserve inner products to about 1.5 %: a difference below twice that is none.
        if nearest[further] > 0.97:
            break
        kept.append(further)
    return [traces[i] for i in kept]


def _compatible(one: Proposal, other: Proposal) -> bool:
    """Whether two proposals are different physics, so that a model can have both."""
    if one.name == other.name or (one.replaces is not None and one.replaces == other.replaces):
        return False
    a, b = one.effect, other.effect
    if a.name in b.degenerates_to or b.name in a.degenerates_to:
        return False
    return one.at != other.at or not {a.name, *a.contains} & {b.name, *b.contains}
