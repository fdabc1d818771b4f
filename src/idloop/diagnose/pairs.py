"""Effects that show only together.

Two effects may leave opposite traces: dry friction beside a drag that grows with the square of the speed is, to a model
with viscous friction, hardly anything, while each of them alone would be plain to see. Where no single effect shows,
pairs whose traces resemble each other are screened by the score statistic of both traces at once, as far as each of the
two hides a part of the other, and the best few are fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.confirm import Confirmed, points, search, starts
from idloop.diagnose.proposals import Proposal, proposals
from idloop.diagnose.screen import Screen, Screened, Trace
from idloop.errors import IdloopError
from idloop.estimate.likelihood.refit import refit
from idloop.estimate.likelihood.setting import Setting
from idloop.physics.trial import Trial

Array = NDArray[np.float64]

# Traces that are nearly one direction are one effect; those that have little in common hide nothing.
MOST_ALIKE, LEAST_ALIKE = 0.98, 0.1
# Shapes of one effect that differ by less than this are one shape, and traces that take part at most.
_SAME_SHAPE, MOST_TRACES = 0.97, 150
# Pairs whose traces are taken together anew, and of these the ones that are refitted.
_MOST_JOINED, _MOST_PAIRS = 24, 8


@dataclass(frozen=True)
class Scored:
    """Two traces of different effects.

    Attributes
    ----------
    first, second : int
        Places among the traces.
    statistic : float
        Of both together; not yet less for a variance that is uneven.
    """

    first: int
    second: int
    statistic: float


class Pairs:
    """Traces that can be paired.

    Parameters
    ----------
    screened : sequence of Screened
        Effects with their traces; those of more than one direction take no part.

    Attributes
    ----------
    traces : list of tuple of Proposal and Trace
    alike : array, shape (m, m)
        Correlations of the traces, to a few per cent of what they leave to 1.
    allowed : array of bool, shape (m, m)
        Pairs that are tested, above the diagonal.
    """

    def __init__(self, screened: Sequence[Screened]) -> None:
        groups = []
        for s in screened:
            # What has no parameters is there or not, and has no weak form that a trace could show.
            traces = [t for t in s.traces if len(t.scores) == len(t.trials) == 1]
            if traces and s.proposal.effect.parameters:
                groups.append([(s.proposal, trace) for trace in _shapes(traces)])
        # The same number of shapes for everyone, as many as there is time for.
        most = max((len(g) for g in groups), default=0)
        while most > 1 and sum(min(len(g), most) for g in groups) > MOST_TRACES:
            most -= 1
        self.traces = [member for g in groups for member in g[:most]]
        columns = _columns([t for _, t in self.traces])
        self.alike = np.clip(columns.T @ columns, -1.0, 1.0)
        self._sided = np.array([p.one_sided for p, _ in self.traces], dtype=bool)
        close = np.abs(self.alike)
        self.allowed = np.triu((close > LEAST_ALIKE) & (close < MOST_ALIKE), 1)
        # Two effects that can only grow hide each other where their traces are opposite.
        self.allowed &= ~(self._sided[:, None] & self._sided[None, :] & (self.alike > 0.0))
        for i, (one, _) in enumerate(self.traces):
            for j in np.flatnonzero(self.allowed[i]):
                self.allowed[i, j] = _two_things(one, self.traces[j][0])

    def statistics(self, scores: Array, first: int) -> Array:
        """Joint statistics of all pairs whose earlier member is given.

        Parameters
        ----------
        scores : array, shape (n, m)
            Errors along the traces, in their standard deviation, one row for each set of errors.
        first : int

        Returns
        -------
        array, shape (n, number of pairs allowed)
            [s₁ s₂] G⁻¹ [s₁ s₂]ᵀ with the correlation matrix G; 0 where an effect would have the wrong
            sign, or where the two do not hide each other.
        """
        others = np.flatnonzero(self.allowed[first])
        alike = self.alike[first, others]
        one, other = scores[:, first, None], scores[:, others]
        left, right = one - alike * other, other - alike * one
        value = (one * left + other * right) / (1.0 - alike**2)
        good = alike * left * right < 0.0
        if self._sided[first]:
            good &= left > 0.0
        good &= (right > 0.0) | ~self._sided[others]
        return np.asarray(np.where(good, value, 0.0))

    def ranked(self) -> list[Scored]:
        """The best shapes of every two effects, best first.

        How uneven the errors are along each trace alone says little: what the other one would explain
        is still among them. It is reckoned with where the two are taken together.
        """
        scores = np.array([[t.scores[0] for _, t in self.traces]])
        best: dict[tuple[str, str], Scored] = {}
        for first in np.flatnonzero(np.any(self.allowed, axis=1)):
            others = np.flatnonzero(self.allowed[first])
            for second, value in zip(others, self.statistics(scores, int(first))[0], strict=True):
                names = self.traces[first][0].name, self.traces[second][0].name
                if value > 0.0 and (names not in best or value > best[names].statistic):
                    best[names] = Scored(int(first), int(second), float(value))
        return sorted(best.values(), key=lambda s: -s.statistic)


@dataclass(frozen=True)
class Joined:
    """Two effects as the screening saw them together.

    Attributes
    ----------
    first, second : tuple of Proposal and Trace
        The first one does more.
    trace : Trace
        Of both, with the size of each.
    """

    first: tuple[Proposal, Trace]
    second: tuple[Proposal, Trace]
    trace: Trace

    @property
    def names(self) -> tuple[str, str]:
        """Both, as ``effect@site``."""
        return self.first[0].name, self.second[0].name


def confirmed_pairs(
    screen: Screen,
    screened: Sequence[Screened],
    bar: float,
    report: Callable[[float, str], None] | None = None,
) -> list[tuple[Confirmed, Confirmed]]:
    """Refit the parent with both effects of the pairs that promise most.

    Parameters
    ----------
    screen : Screen
    screened : sequence of Screened
    bar : float
        Statistic from which on a single effect shows: each of the two must add as much to the other one, or it may be
        chance beside an effect that nearly shows by itself.
    report : callable, optional
        Called with the share done and a text.

    Returns
    -------
    list of tuple
        The first effect, which does more, and the second one on top of it, both with the model that has both.
    """
    setting, parent = screen.setting, screen.parent
    found = search(
        setting,
        parent,
        _promising(screen, screened, bar),
        lambda joined: _confirm(screen, joined),
        lambda share, joined: report(share, " and ".join(joined.names)) if report is not None else None,
    )
    return [(replace(both, proposal=joined.first[0]), both) for joined, both in found]


def _promising(screen: Screen, screened: Sequence[Screened], bar: float) -> list[Joined]:
    """The pairs that a score test of the traces themselves finds promising, best first; sketches chose them."""
    pairs, alone = Pairs(screened), {s.proposal.name: s.statistic for s in screened}
    found = []
    for scored in pairs.ranked()[:_MOST_JOINED]:
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
        found.append(Joined(one, other, trace))
    return sorted(found, key=lambda joined: -joined.trace.statistic)[:_MOST_PAIRS]


def _confirm(screen: Screen, joined: Joined) -> Confirmed | None:
    setting, parent = screen.setting, screen.parent
    choices: list[tuple[Trial, Trial]] = []
    for place in (-1, 0):
        # The last start has the size of the joint solution, the first one that of the trial.
        values = [
            starts(proposal, replace(trace, size=joined.trace.size[i : i + 1]))[place]
            for i, (proposal, trace) in enumerate((joined.first, joined.second))
        ]
        choices.append((values[0], values[1]))
    tops = [_on_top(joined.first[0], values, joined.second[0], setting) for values, _ in choices]
    if tops[0] is None:
        return None
    models = [top.model(values) for top, (_, values) in zip(tops, choices, strict=True) if top is not None]
    thetas = [theta for start in models for theta in points(parent, start, joined.trace.shift)]
    scale = np.max(np.abs(np.array(thetas)), axis=0)
    fit = refit(setting, models[0], thetas, parent, scale, rounds=1)
    return Confirmed(tops[0], fit, 0.0, joined.trace.statistic).refitted(fit, parent)


def _on_top(first: Proposal, values: Trial, second: Proposal, setting: Setting) -> Proposal | None:
    """The second effect, proposed for the model that has the first; None where the two are at odds."""
    try:
        found = proposals(first.model(values), [second.name], setting.conditions)
    except IdloopError:
        return None
    return next((p for p in found if p.name == second.name and p.replaces == second.replaces), None)


def _columns(traces: Sequence[Trace]) -> Array:
    """Directions beside each other, shape (SKETCH, m)."""
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
        if nearest[further] > _SAME_SHAPE:
            break
        kept.append(further)
    return [traces[i] for i in kept]


def _two_things(one: Proposal, other: Proposal) -> bool:
    """Whether two proposals are different physics, so that a model can have both."""
    if one.name == other.name or (one.replaces is not None and one.replaces == other.replaces):
        return False
    a, b = one.effect, other.effect
    if a.name in b.degenerates_to or b.name in a.degenerates_to:
        return False
    return one.at != other.at or not {a.name, *a.contains} & {b.name, *b.contains}
