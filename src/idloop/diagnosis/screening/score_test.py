"""Score test of the whole catalogue in one pass.

The trace of an effect is the change of the whitened errors when the model has the effect at trial values. What the free
parameters and the noise level can produce as well is projected out; the rest is correlated with the errors (Rao's score
test; Ljung, System Identification, 2nd ed., section 16.4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.residual_curves.periods import residual_period
from idloop.diagnosis.screening.proposals import Proposal
from idloop.diagnosis.screening.typical_sizes import Sizes
from idloop.errors import IdloopError
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.likelihood.heteroscedasticity import heteroscedasticity
from idloop.estimation.likelihood.parallel import in_parallel
from idloop.estimation.likelihood.refit import Refit
from idloop.estimation.observer.innovations import InnovationCriterion
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics import kernel
from idloop.physics.model import Model
from idloop.physics.trial import Scales, Trial

Array = NDArray[np.float64]

# Trials with a larger trace are repeated with a weaker effect.
_MOST_DETECTABLE = 1e5


@dataclass(frozen=True)
class Trace:
    """Change of the errors by one alternative of trial values, in g directions."""

    trials: list[Trial]  # values, one per direction
    statistic: float  # twice the gain in log-likelihood that it promises, robust to heteroscedasticity
    size: Array  # coefficient of each direction, shape (g,): 1 means the trial values themselves
    detectable: float  # twice the log-likelihood that the effect would gain at the trial values
    own_part: float  # of the trace: what the free parameters cannot produce
    sketch: Array  # orthonormal directions, sketched, one column each; their sign is that of the trace
    scores: (
        Array  # errors along these directions, in their standard deviation; above 0 an effect of this sign reduces them
    )
    weakest: float = 0.0  # as `detectable`, of the weakest direction
    uneven: float = 1.0  # variance of the errors along the trace, relative to all, at least 1
    typical: float = 0.0  # as `detectable`, at the strength before it was made weaker
    shift: Array | None = None  # expected move of the free parameters with the effect, shape (k,)

    @property
    def direction(self) -> Array | None:
        """Of length 1, sketched; None where the trace is not one direction."""
        if self.sketch.shape[1] != 1:
            return None
        column = self.sketch[:, 0]
        return np.asarray(column / max(float(np.linalg.norm(column)), 1e-300))


@dataclass(frozen=True)
class Screened:
    """All alternatives of one proposal."""

    proposal: Proposal
    traces: list[Trace]
    tried: bool = True  # at any values
    choices: int = 1  # of whole numbers and periods that it was tried with

    @property
    def statistic(self) -> float:
        """Of the best alternative."""
        return max((t.statistic for t in self.traces), default=0.0)

    @property
    def promised(self) -> float:
        """Power of the whitened errors that the best alternative would explain."""
        return max((float(t.scores @ t.scores) for t in self.traces), default=0.0)

    @property
    def own_part(self) -> float:
        """Largest part of a trace that the free parameters cannot produce."""
        return max((t.own_part for t in self.traces), default=0.0)


class Screen:
    """The errors of a fitted model, to be correlated with traces of effects; `seed` is that of the sketches."""

    def __init__(self, estimation: EstimationProblem, parent: Refit, seed: int) -> None:
        self.estimation, self.parent = estimation, parent
        self.sizes = Sizes(parent.model, estimation)
        problem, point = parent.problem, parent.point
        self.errors = self.whitened = parent.residual()
        k, slopes = parent.parameters, parent.jacobian
        self._back = np.linalg.pinv(slopes[:, :k], rcond=1e-6)
        self._own, _ = np.linalg.qr(slopes[:, :k])
        slopes = slopes[:, parent.sensitive]
        left, weight, _ = np.linalg.svd(slopes / np.linalg.norm(slopes, axis=0), full_matrices=False)
        # Parameters that the data cannot separate span fewer directions.
        self.basis = left[:, weight > 1e-6 * max(float(np.max(weight, initial=0.0)), 1e-300)]
        # The fit is not exactly at its optimum: what its slopes still explain belongs to the parameters.
        self.errors = self.errors - self.basis @ (self.basis.T @ self.errors)
        rows = len(self.errors)
        self._signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=rows)
        self._records = problem.rows_of_records(point) if len(estimation.records) > 1 else []
        # Random signs and sums over 4096 stretches preserve inner products of traces to about 1.5 %.
        self._edges = np.unique(np.linspace(0, rows, 4097).astype(np.int64)[:-1])

    @cached_property
    def period(self) -> tuple[float, int] | None:
        """As of `residual_period`."""
        return residual_period(self.parent.model, self.estimation)

    @np.errstate(all="ignore")
    def __call__(self, proposal: Proposal) -> Screened:
        """Traces of all alternatives of one proposal."""
        scales = self.sizes.at(proposal.effect.site, proposal.at)
        along = proposal.effect.any_period and proposal.at == proposal.base.bodies[0]
        periods = 1
        if along and self.period is not None:
            strongest, periods = self.period
            scales = replace(scales, periods=(strongest,))
        traces = []
        share, weakest = 1.0, _weakest(proposal, scales)
        alternatives = proposal.alternatives(scales)
        for trials in alternatives:
            weak = trials in weakest
            trace, asked = self._weak_trace(proposal, trials, share) if weak else (self._trace(proposal, trials), 1.0)
            share = asked if weak else share
            if trace is not None:
                traces.append(replace(trace, typical=max(trace.detectable, trace.detectable / asked**2)))
        numbers = {tuple(trials[0].get(name) for name in proposal.whole_numbers) for trials in alternatives}
        return Screened(proposal, traces, bool(alternatives), max(len(numbers), 1) * periods)

    def _weak_trace(self, proposal: Proposal, trials: list[Trial], share: float) -> tuple[Trace | None, float]:
        """Trace at a strength at which it is not far above the noise, as a weak effect is, and the share of that."""
        trace = self._trace(proposal, [proposal.weaker(trial, share) for trial in trials])
        for _ in range(3):
            if trace is None or not trace.detectable > _MOST_DETECTABLE:
                break
            share = max(share * max(float(np.sqrt(0.01 * _MOST_DETECTABLE / trace.detectable)), 1e-3), 1e-9)
            trace = self._trace(proposal, [proposal.weaker(trial, share) for trial in trials])
        return trace, share

    def all(
        self, proposals: Sequence[Proposal], report: Callable[[float, str], None] = lambda share, text: None
    ) -> list[Screened]:
        """Screen many proposals on all cores."""
        found = []
        for screened in in_parallel(self, proposals):
            found.append(screened)
            report(len(found) / len(proposals), screened.proposal.name)
        return found

    def response_to_effect(self, proposal: Proposal, trial: Trial) -> Array | None:
        """Change of the whitened errors that an effect at given values makes; None where it cannot be simulated."""
        other = proposal.effect.linear or proposal.effect.splits
        return self._changed(self.estimation, lambda: proposal.model(trial), other_linear_part=other)

    def response_to_force(self, forces: Sequence[Array]) -> Array | None:
        """Change of the whitened errors that a force on the driven body makes, held like the command.

        The forces are those at the instants of each record's measurements. None where it cannot be simulated. A force
        below a dead zone at the input moves nothing.
        """
        model = self.parent.model
        gain = float(CachingEngine(model).layout(None).axis.constants[kernel.GAIN])
        data = tuple(
            replace(d, input=d.input + np.interp(d.input_time, d.time, force) / gain)
            for d, force in zip(self.estimation.data, forces, strict=True)
        )
        return self._changed(replace(self.estimation, data=data), lambda: model, other_linear_part=False)

    def beside_parameters(self, errors: Array) -> Array:
        """Errors without what a small change of the model's parameters explains, the noise model held."""
        return np.asarray(errors - self._own @ (self._own.T @ errors))

    def _changed(
        self, estimation: EstimationProblem, modelled: Callable[[], Model], *, other_linear_part: bool
    ) -> Array | None:
        """Change of the whitened errors with another model or other commands."""
        parent = self.parent
        try:
            model = modelled()
            criterion = estimation.criterion(model)
            criterion.keep(parent.nuisance)
            theta = model.theta
            own = parent.criterion
            if isinstance(criterion, InnovationCriterion) and isinstance(own, InnovationCriterion):
                if other_linear_part:
                    criterion.retune(theta)
                else:
                    criterion.adopt(own)
            nuisance = criterion.nuisance()[0][: len(parent.nuisance)]
            change = parent.problem.whiten(criterion.errors(theta, nuisance)) - self.whitened
        except (IdloopError, np.linalg.LinAlgError, ValueError):
            return None
        return change if np.all(np.isfinite(change)) else None

    def joint(self, first: tuple[Proposal, Trial], second: tuple[Proposal, Trial]) -> Trace | None:
        """Trace of two effects at given values, with one size for each; None without two directions."""
        sides = (first[0].one_sided, second[0].one_sided)
        trace = self._measure(
            [first[1], second[1]], [self.response_to_effect(*first), self.response_to_effect(*second)], sides
        )
        return trace if trace is not None and len(trace.scores) == 2 else None

    def _trace(self, proposal: Proposal, trials: list[Trial]) -> Trace | None:
        sides = [len(trials) == 1 and proposal.one_sided] * len(trials)
        return self._measure(trials, [self.response_to_effect(proposal, trial) for trial in trials], sides)

    def _measure(self, trials: list[Trial], columns: list[Array | None], sides: Sequence[bool]) -> Trace | None:
        """Trace of changes of the errors, one for each trial; sizes of `sides` must not be negative."""
        if any(c is None for c in columns) or not columns:
            return None
        raw = np.stack([c for c in columns if c is not None]).T
        with np.errstate(over="ignore"):
            power = np.sum(raw**2, axis=0)
        if not np.all(np.isfinite(power)):
            return self._invisible(trials, 1e300, 1.0)
        if not np.any(power > 1e-12):
            return self._invisible(trials, 0.0, 0.0)
        own = raw - self.basis @ (self.basis.T @ raw)
        # A single record shows an effect where twice the log-likelihood is 25.
        parts = [_parts(raw, own, 0.0), *(_parts(raw[rows], own[rows], 25.0) for rows in self._records)]
        own_part = float(np.max(parts))
        powers = np.sum(own**2, axis=0)
        detectable, weakest = float(np.max(powers)), float(np.min(powers))
        q, r = np.linalg.qr(own)
        useful = np.abs(np.diag(r)) > 1e-3 * np.max(np.abs(np.diag(r)))
        q, r = q[:, useful], r[np.ix_(useful, useful)]
        # A rest below the rounding of its projection is zero.
        if own_part < 1e-8:
            return self._invisible(trials, detectable, own_part)
        # A factorisation may reverse a direction; one-sided tests need its sign.
        turn = np.where(np.diag(r) < 0.0, -1.0, 1.0)
        q, r = q * turn, r * turn[:, None]
        scores = -(q.T @ self.errors)
        size = np.zeros(len(trials))
        size[useful] = np.linalg.solve(r, scores)
        uneven = heteroscedasticity(q, self.errors + q @ scores)
        statistic = 0.0 if np.any(size[np.asarray(sides)] < 0.0) else float(scores @ scores) / uneven
        shift = -self._back @ (raw @ size)
        sketch = np.add.reduceat(q * self._signs[:, None], self._edges, axis=0)
        return Trace(
            trials, statistic, size, detectable, own_part, sketch, scores, weakest, uneven, detectable, shift
        )  # fmt: skip

    def _invisible(self, trials: list[Trial], detectable: float, own_part: float) -> Trace:
        """A trace without a direction of its own."""
        none = np.zeros((len(self._edges), 0))
        return Trace(trials, 0.0, np.zeros(len(trials)), detectable, own_part, none, np.zeros(0))


def _parts(raw: Array, own: Array, least: float) -> Array:
    """Own part of each trace; 0 where its power is below the least."""
    worth = np.sum(own**2, axis=0)
    return np.asarray(np.where(worth >= least, worth / np.maximum(np.sum(raw**2, axis=0), 1e-300), 0.0))


def _weakest(proposal: Proposal, scales: Scales) -> list[list[Trial]]:
    """Of the alternatives that differ in strength alone, the weakest."""
    strength = proposal.effect.strength
    found: dict[tuple[tuple[tuple[str, float], ...], ...], list[Trial]] = {}
    for trials in proposal.alternatives(scales):
        shape = tuple(tuple(sorted((k, v) for k, v in t.items() if k != strength)) for t in trials)
        rival = found.get(shape)
        if rival is None or abs(trials[0].get(strength, 0.0)) < abs(rival[0].get(strength, 0.0)):
            found[shape] = trials
    return list(found.values())
