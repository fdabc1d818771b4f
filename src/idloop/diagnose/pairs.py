"""Effects that show only together.

Two effects may leave opposite traces: dry friction beside a drag that grows with the square of
the speed is, to a model with viscous friction, hardly anything, while each of them alone would
be plain to see. Where no single effect is significant, all pairs whose traces resemble each
other are tested jointly, by the score statistic of both traces at once, as far as each of the
two hides a part of the other. What the best of them reaches by chance is known as for single
effects (`calibrate`): random errors are projected on the same traces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.calibrate import exceedance
from idloop.diagnose.confirm import MORE_ROUNDS, Confirmed, points, search, starts
from idloop.diagnose.evidence import consistent, distinguishable, holds, statistic
from idloop.diagnose.proposals import Proposal, proposals
from idloop.diagnose.refit import Refit, refit, refit_or_none
from idloop.diagnose.screen import Screen, Screened, Trace
from idloop.diagnose.setting import Setting
from idloop.errors import IdloopError
from idloop.physics.trial import Trial

Array = NDArray[np.float64]

# How the error rate is shared between single effects and pairs.
SINGLE_SHARE, PAIR_SHARE = 0.8, 0.2
# Traces that are nearly one direction are one effect; those that have little in common hide nothing.
MOST_ALIKE, LEAST_ALIKE = 0.98, 0.1
# Shapes of one effect that differ by less than this are one shape.
_SAME_SHAPE = 0.97
# Random errors that are drawn, how many at once, and traces that take part at most.
DRAWS, MOST_TRACES = 2000, 150
_CHUNK = 250
# Pairs whose traces are taken together anew, and of these the ones that are refitted.
_MOST_JOINED, _MOST_PAIRS = 24, 8


def single_share(kind: str) -> float:
    """Part of the error rate that single effects have, the rest is the pairs'.

    A force balance or a free run is limited by what the model still lacks. Two opposite traces take
    up a little of anything between them, and no draw of white errors says how much: there pairs
    are not searched.

    Parameters
    ----------
    kind : {"prediction", "simulation", "force"}
        The criterion.
    """
    return SINGLE_SHARE if kind == "prediction" else 1.0


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
    """Traces that can be paired, and how well the best pair does by chance.

    Which pairs there are does not depend on the errors: data and chance choose from the same.

    Parameters
    ----------
    screened : sequence of Screened
        Effects with their traces; those of more than one direction take no part.
    seed : int
        Of the random errors.

    Attributes
    ----------
    traces : list of tuple of Proposal and Trace
    alike : array, shape (m, m)
        Correlations of the traces, to a few per cent of what they leave to 1.
    allowed : array of bool, shape (m, m)
        Pairs that are tested, above the diagonal.
    """

    def __init__(self, screened: Sequence[Screened], seed: int) -> None:
        self.seed = seed
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

    @cached_property
    def largest(self) -> Array:
        """Statistic of the best pair for random errors, shape (DRAWS,), sorted."""
        if not np.any(self.allowed):
            return np.zeros(DRAWS)
        values, vectors = np.linalg.eigh(self.alike)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        generator = np.random.default_rng(self.seed)
        found = []
        for _ in range(0, DRAWS, _CHUNK):
            scores = generator.normal(size=(_CHUNK, len(root))) @ root.T
            best = np.zeros(_CHUNK)
            for first in np.flatnonzero(np.any(self.allowed, axis=1)):
                np.maximum(best, np.max(self.statistics(scores, int(first)), axis=1), out=best)
            found.append(best)
        return np.sort(np.concatenate(found))

    def p_value(self, value: float) -> float:
        """Probability that the best pair does as well by chance, divided by the pairs' share of the error rate."""
        if not np.any(self.allowed):
            return 1.0
        return min(exceedance(self.largest, value) / PAIR_SHARE, 1.0)

    def threshold(self, level: float) -> float:
        """Statistic whose p-value is the level, where the draws are many enough to tell."""
        return float(np.quantile(self.largest, 1.0 - PAIR_SHARE * level))

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


@dataclass(frozen=True)
class Pair:
    """Two effects after their refit.

    Attributes
    ----------
    first, second : Proposal
        Each by itself; the first one does more.
    together : Confirmed
        The second one on top of the first, with the model that has both.
    """

    first: Proposal
    second: Proposal
    together: Confirmed

    @property
    def names(self) -> tuple[str, str]:
        """``effect@site`` of both."""
        return self.first.name, self.second.name


@dataclass(frozen=True)
class MissingPair:
    """The pair that is missing.

    Attributes
    ----------
    best : Pair
    alone : Refit
        With its first effect only.
    rivals : tuple of Pair
        Other pairs that this data cannot tell from it.
    p_values : dict
        Of the pair and its rivals by their names, over all pairs and divided by their share of the error rate.
    """

    best: Pair
    alone: Refit
    rivals: tuple[Pair, ...]
    p_values: dict[tuple[str, str], float]

    def ties(self, member: int) -> tuple[str, ...]:
        """Effects that would do in the place of the first or the second (0, 1), beside the other: itself first."""
        own, other = self.best.names[member], self.best.names[1 - member]
        return tied_members(own, other, [pair.names for pair in self.rivals])


def tied_members(own: str, other: str, rivals: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Effects that rival pairs have in the place of one effect beside another one, that one itself first."""
    found = [name for names in rivals if other in names for name in names if name != other]
    return tuple(dict.fromkeys((own, *found)))


def promising_pairs(
    screen: Screen, screened: Sequence[Screened], pairs: Pairs, level: float, bar: float
) -> list[Joined]:
    """The pairs that the score test holds for significant, best first.

    Parameters
    ----------
    screen : Screen
    screened : sequence of Screened
    pairs : Pairs
    level : float
        Error rate over single effects and pairs together.
    bar : float
        Statistic that a single effect needs: each of the two must add as much to the other one, or
        it may be chance beside an effect that is nearly significant by itself.

    Returns
    -------
    list of Joined
        A few. Their statistics are of the traces themselves; those of the sketches chose them.
    """
    alone = {s.proposal.name: s.statistic for s in screened}
    found = []
    for scored in pairs.ranked()[:_MOST_JOINED]:
        if pairs.p_value(scored.statistic) >= level:
            break
        one, other = pairs.traces[scored.first], pairs.traces[scored.second]
        trace = screen.joint((one[0], one[1].trials[0]), (other[0], other[1].trials[0]))
        if trace is None or pairs.p_value(trace.statistic) >= level:
            continue
        if trace.statistic - max(alone[one[0].name], alone[other[0].name]) < bar:
            continue
        done = np.abs(trace.size) * np.sqrt([one[1].detectable, other[1].detectable])
        if done[1] > done[0]:
            one, other = other, one
            trace = replace(trace, trials=trace.trials[::-1], size=trace.size[::-1])
        found.append(Joined(one, other, trace))
    return sorted(found, key=lambda joined: -joined.trace.statistic)[:_MOST_PAIRS]


def confirm_pairs(
    setting: Setting,
    parent: Refit,
    chosen: Sequence[Joined],
    report: Callable[[float, str], None] | None = None,
) -> list[Pair]:
    """Refit the parent with both effects of each of some pairs.

    Parameters
    ----------
    setting : Setting
    parent : Refit
    chosen : sequence of Joined
    report : callable, optional
        Called with the share done and a text.

    Returns
    -------
    list of Pair
        In order of falling gain; those that cannot be simulated are left out.
    """
    found = search(
        setting,
        parent,
        chosen,
        lambda joined: _confirm(setting, parent, joined),
        lambda share, joined: report(share, " and ".join(joined.names)) if report is not None else None,
    )
    return [Pair(joined.first[0], joined.second[0], confirmed) for joined, confirmed in found]


def judge_pairs(
    setting: Setting,
    parent: Refit,
    found: Sequence[Pair],
    pairs: Pairs,
    *,
    level: float,
    bar: float,
    held_out: Setting | None = None,
) -> MissingPair | None:
    """Which of the refitted pairs is missing, and what the data cannot tell from it.

    Parameters
    ----------
    setting : Setting
    parent : Refit
    found : sequence of Pair
    pairs : Pairs
    level, bar : float
        As in `promising_pairs`.
    held_out : Setting, optional
        Validation records, on which the pair must do no harm.

    Returns
    -------
    MissingPair or None
        None when no pair is significant of which each effect is needed.
    """
    significant = [
        pair
        for pair in sorted(found, key=lambda pair: -pair.together.gain)
        if pairs.p_value(statistic(pair.together)) < level
        and consistent(parent, pair.together, setting.kind)
        and (held_out is None or holds(held_out, parent, pair.together))
    ]
    for best in significant:
        both = best.together.fit
        alone = [_alone(setting, parent, proposal, both) for proposal in (best.first, best.second)]
        needed = 0.5 * bar * best.together.uneven
        if alone[0] is None or any(a is not None and both.log_likelihood - a.log_likelihood < needed for a in alone):
            continue
        rivals = [
            pair for pair in significant
            if pair is not best and not distinguishable(both, pair.together.fit)
        ]  # fmt: skip
        values = {pair.names: pairs.p_value(statistic(pair.together)) for pair in (best, *rivals)}
        return MissingPair(best, alone[0], tuple(rivals), values)
    return None


def _confirm(setting: Setting, parent: Refit, joined: Joined) -> Confirmed | None:
    choices: list[tuple[Trial, Trial]] = []
    for place in (-1, 0):
        # The last start has the size of the joint solution, the first one that of the trial.
        values = [
            starts(proposal, replace(trace, size=joined.trace.size[i : i + 1]))[place]
            for i, (proposal, trace) in enumerate((joined.first, joined.second))
        ]
        choices.append((values[0], values[1]))
    tops = [_on_top(joined.first[0], values, joined.second[0]) for values, _ in choices]
    if tops[0] is None:
        return None
    models = [top.model(values) for top, (_, values) in zip(tops, choices, strict=True) if top is not None]
    thetas = [theta for start in models for theta in points(parent, start, joined.trace.shift)]
    scale = np.max(np.abs(np.array(thetas)), axis=0)
    fit = refit(setting, models[0], thetas, parent, scale, rounds=1)
    return Confirmed(tops[0], fit, 0.0, joined.trace.statistic, joined.trace.uneven).refitted(fit, parent)


def _on_top(first: Proposal, values: Trial, second: Proposal) -> Proposal | None:
    """The second effect, proposed for the model that has the first; None where the two are at odds."""
    try:
        found = proposals(first.model(values), [second.name])
    except IdloopError:
        return None
    return next((p for p in found if p.name == second.name and p.replaces == second.replaces), None)


def _alone(setting: Setting, parent: Refit, proposal: Proposal, both: Refit) -> Refit | None:
    """One effect of a pair by itself, searched from where both are and from where neither is."""
    prefix = f"{proposal.name}."
    found = both.model.values
    own = {name.removeprefix(prefix): value for name, value in found.items() if name.startswith(prefix)}
    model = proposal.model(own)
    before = dict(zip(parent.model.free, parent.point, strict=False))
    thetas = [
        np.array([values.get(name, model.values[name]) for name in model.free])
        for values in (found, {**before, **{n: v for n, v in found.items() if n.startswith(prefix)}})
    ]
    return refit_or_none(setting, model, thetas, parent, rounds=MORE_ROUNDS)


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
