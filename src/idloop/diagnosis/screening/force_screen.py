"""What the traces of effects promise that they would leave in a force balance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.identifiability import NOT_REPEATED, OWN_PART
from idloop.diagnosis.residual_curves.periods import harmonics, period_between_harmonics, unexplained_period
from idloop.diagnosis.screening.proposals import Proposal
from idloop.diagnosis.screening.typical_sizes import Sizes
from idloop.diagnosis.search.step import LEAST_GAIN
from idloop.errors import IdloopError
from idloop.estimation.force_balance.weak_fit import MOST_ITERATIONS, RANKING_TOLERANCE, WeakFit, fit_weak
from idloop.estimation.force_balance.weak_form import WeakForm
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics.effect import OUTPUT
from idloop.physics.model import Model
from idloop.physics.trial import Trial

Array = NDArray[np.float64]

# Alternatives of one effect from which a fit begins; those of other whole numbers, such as harmonics, that are fitted.
STARTS, _WHOLE_NUMBERS = 2, 4
# The inertia beside an effect is at least this part of that without it: what takes it away switches the command off.
_LEAST_INERTIA = 1.0 / 30.0


def acts_in_balance(proposal: Proposal) -> bool:
    """Whether a force balance along the measured motion contains an effect."""
    return proposal.effect.site != OUTPUT and not proposal.effect.splits


def fit_in(
    form: WeakForm, model: Model, shift: float, tolerance: float = RANKING_TOLERANCE, rounds: int = MOST_ITERATIONS
) -> WeakFit | None:
    """A model fitted in the windows of another one, from its values and a time from stamp to action [s].

    None where it cannot be. A further iteration must promise `tolerance` of log-likelihood.
    """
    form = form.with_engine(CachingEngine(model))
    start = np.append(model.theta, shift) if form.free_timing else model.theta
    try:
        found = fit_weak(form, start, rounds=rounds, tolerance=tolerance)
    except (IdloopError, np.linalg.LinAlgError):
        return None
    return found if np.isfinite(found.log_likelihood) else None


def _inertia(fit: WeakFit) -> float:
    """Inertia of the driven body over the drive's gain: the common scale of both may be unknown."""
    return float(fit.form.inertia(fit.theta)[0]) / fit.form.gain(fit.theta)


def loses_inertia(fit: WeakFit, parent: WeakFit) -> bool:
    """Whether an effect explains the force in place of the inertia: nothing would be left to move."""
    return _inertia(fit) < _LEAST_INERTIA * _inertia(parent)


@dataclass(frozen=True)
class Promising:
    """What the trace of an effect promises, and from where its fit begins."""

    proposal: Proposal
    promise: float  # log-likelihood
    typical: float  # log-likelihood that the effect would be worth at its typical size
    own_part: float  # of its trace, which the free parameters cannot produce
    starts: list[Trial]
    tried: bool = True  # at any values

    def apart(self) -> list[Promising]:
        """One for each choice of the whole numbers, such as a harmonic, which a fit does not change."""
        whole = self.proposal.whole_numbers
        groups: dict[tuple[float, ...], list[Trial]] = {}
        for start in self.starts:
            groups.setdefault(tuple(start[name] for name in whole), []).append(start)
        return [replace(self, starts=group) for group in groups.values()]


class ForceScreen:
    """Correlates the traces that effects would leave in a force balance with what it leaves unexplained.

    Traces are computed in the windows of `parent`, some of those of `whole`.
    """

    def __init__(self, estimation: EstimationProblem, whole: WeakFit, parent: WeakFit) -> None:
        self.parent, self.model = parent, (model := parent.model)
        self._share = len(parent.rows) / len(whole.rows)
        self.sizes = Sizes(model, estimation)
        _, slopes = parent.linear
        self._size = np.sqrt(np.mean(parent.residual**2, axis=0))
        self.errors = (parent.residual / self._size).ravel()
        slopes = slopes.reshape(-1, slopes.shape[-1])
        norms = np.linalg.norm(slopes, axis=0)
        left, weight, _ = np.linalg.svd(slopes / np.where(norms > 0.0, norms, 1.0), full_matrices=False)
        known = weight > 1e-6 * np.max(weight, initial=0.0)
        self.basis = left[:, known]
        self.errors = self.errors - self.basis @ (self.basis.T @ self.errors)
        found = {body: harmonics(whole, index) for index, body in enumerate(model.bodies)}
        self._harmonics = {body: several for body, (several, _) in found.items()}
        period = period_between_harmonics if model.units.position == "rad" else unexplained_period
        repeated = {body: period(whole, index) for index, body in enumerate(model.bodies)}
        self.periods = {body: one for body, one in repeated.items() if one is not None}
        self.waves = sum(tried for _, tried in (*found.values(), *self.periods.values()))

    def __call__(self, proposal: Proposal) -> Promising:
        """What an effect promises; without starts where it promises nothing."""
        scales = self.sizes.at(proposal.effect.site, proposal.at)
        periods = self.periods.get(proposal.at, ())[:1]
        scales = replace(scales, harmonics=self._harmonics.get(proposal.at, ()), periods=periods)
        found, typical, part = [], 0.0, 0.0
        alternatives = proposal.alternatives(scales)
        for trials in alternatives:
            columns = [self._trace(proposal, trial) for trial in trials]
            if any(column is None for column in columns):
                continue
            raw = np.stack([column for column in columns if column is not None]).T
            own = raw - self.basis @ (self.basis.T @ raw)
            powers = np.sum(own**2, axis=0)
            typical = max(typical, 0.5 * float(np.max(powers)) / self._share)
            part = max(part, float(np.max(powers / np.maximum(np.sum(raw**2, axis=0), 1e-300))))
            size, *_ = np.linalg.lstsq(own, -self.errors, rcond=1e-6)
            if len(trials) == 1 and proposal.one_sided:
                size = np.maximum(size, 0.0)
            promise = self._gain(self.errors + own @ size)
            if np.isfinite(promise):
                first = promise
                if len(trials) == 1 and proposal.weaker(trials[0], 0.5) == trials[0]:
                    # An effect without a strength, such as a limit, begins as it was tried: beside a command that it
                    # cuts off, inertia and gain are others.
                    first = self._first_gain(proposal.model(trials[0]))
                found.append((first, promise, trials, size))
        most = max((promise for _, promise, *_ in found), default=0.0)
        if most < LEAST_GAIN:
            return Promising(proposal, 0.0, typical, part, [], bool(alternatives))
        found.sort(key=lambda one: -one[0])
        several = _WHOLE_NUMBERS if proposal.whole_numbers else STARTS
        starts = [start for *_, trials, size in found[:several] for start in _starts(proposal, trials, size)]
        return Promising(proposal, most, typical, part, starts)

    def _gain(self, left: Array) -> float:
        """Log-likelihood gained where these errors are left."""
        return 0.5 * float(self.errors @ self.errors - left @ left) / self._share

    def _first_gain(self, model: Model) -> float:
        """Log-likelihood gained by one round of a fit; minus infinity where it loses the inertia."""
        fit = fit_in(self.parent.form, model, self.parent.shift, rounds=1)
        if fit is None or loses_inertia(fit, self.parent):
            return -math.inf
        return (fit.log_likelihood - self.parent.log_likelihood) / self._share

    def _trace(self, proposal: Proposal, trial: Trial) -> Array | None:
        model = proposal.model(trial)
        form = self.parent.form.with_engine(CachingEngine(model))
        try:
            residual = form.residual(model.theta, self.parent.shift)
        except IdloopError:
            return None
        change = ((residual - self.parent.residual) / self._size).ravel()
        return change if np.all(np.isfinite(change)) else None


def testable_by_force(
    proposed: Sequence[Proposal], screened: Sequence[Promising], threshold: float
) -> tuple[dict[str, str], dict[str, str]]:
    """Whether the force balance can show each effect, and why: sensors and split bodies are not part of it."""
    testable, why = {}, {}
    for one in screened:
        name = one.proposal.name
        if not one.tried:
            testable[name], why[name] = "no", NOT_REPEATED
        elif one.own_part < OWN_PART:
            testable[name], why[name] = "no", "on this data the free parameters can do the same"
        elif one.typical < threshold:
            testable[name], why[name] = "no", "at its typical size it explains too little force to show"
        else:
            testable[name] = "weak" if one.proposal.effect.from_a_level else "yes"
            why[name] = f"at its typical size it would gain {one.typical:.3g} units of log-likelihood"
    for proposal in proposed:
        if not acts_in_balance(proposal):
            testable[proposal.name] = "no"
            why[proposal.name] = "a force balance along the measured motion does not contain it"
    return testable, why


def _starts(proposal: Proposal, trials: Sequence[Trial], size: Array) -> list[Trial]:
    """Values from which a fit begins: those tried, and what the trace promises of them."""
    if len(trials) > 1 and "phase" in trials[0]:
        # Sine and cosine: their sum is one wave.
        reach = float(np.linalg.norm(size))
        return [proposal.inside({**proposal.weaker(trials[0], reach), "phase": float(np.arctan2(size[1], size[0]))})]
    share = float(np.clip(size[0], -50.0, 50.0))
    scaled = proposal.inside(proposal.weaker(trials[0], share))
    return [trials[0]] if scaled == trials[0] else [trials[0], scaled]
