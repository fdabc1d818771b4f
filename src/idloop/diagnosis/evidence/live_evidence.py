"""Evidence that grows with the samples: each new stretch is scored by models that were fitted to earlier samples alone.

    log E_c = Σ_stretches [log p_c(stretch | fitted to earlier samples) - log p_0(stretch | fitted to earlier samples)]

Every stretch is scored once and never fitted before. The models, the width of the windows and the choice of effects
(others have a term of 0) follow from earlier samples. Were p_0 the density of the samples, E_c would be an e-process:
P(E_c ever reaches m/α) ≤ α/m at any number of interim looks (Ville 1939; Dawid 1984; Grünwald, de Heide and Koolen,
JRSS B 2024). p_0 is fitted, so that this holds to first order; benchmarks/live_evidence.py counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.evidence.deciding_view import requested_force_fit
from idloop.diagnosis.evidence.force_view import ForceView
from idloop.diagnosis.evidence.predictive import Evidence, evidence_of
from idloop.diagnosis.options import MINIMUM_IMPROVEMENT, Options
from idloop.errors import IdloopError
from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.weak_fit import WeakFit
from idloop.estimation.force_balance.weak_form import WeakForm, weak_form
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.physics.model import Model
from idloop.records import Record

Array = NDArray[np.float64]

# Parts of a stretch, from whose sums the correlation of neighbouring windows is estimated.
PARTS = 4


@dataclass(frozen=True)
class Decision:
    """When the evidence for an effect first reached its threshold: end of the stretch [ns], and samples scored."""

    stamp: int
    samples: int


@dataclass(frozen=True)
class Tally:
    """Evidence of one effect on the stretches so far, by differences of the log-densities of their windows."""

    # Over each part of a stretch, and windows in it.
    sums: tuple[float, ...] = ()
    lengths: tuple[int, ...] = ()
    # Of all windows, squared.
    squares: float = 0.0
    decided: Decision | None = None

    def scored(self, difference: Array) -> Tally:
        """With one more stretch, by the differences of the log-densities of its windows."""
        parts = np.array_split(difference, min(PARTS, len(difference)))
        return replace(
            self,
            sums=(*self.sums, *(float(np.sum(part)) for part in parts)),
            lengths=(*self.lengths, *(len(part) for part in parts)),
            squares=self.squares + float(np.sum(difference**2)),
        )

    @property
    def enough(self) -> bool:
        """Whether there are enough parts to estimate their spread: from the second look on."""
        return len(self.sums) >= 2 * PARTS

    @property
    def evidence(self) -> Evidence:
        """Of all stretches, tempered where the errors of neighbouring windows are correlated."""
        return evidence_of(np.array(self.sums), np.array(self.lengths, dtype=float), self.squares)


@dataclass(frozen=True)
class LiveEvidence:
    """Evidence for every effect that a model may lack, as the samples come in."""

    # Against which effects are evaluated, with start values.
    model: Model
    # Probability that any effect is ever decided where nothing is missing.
    level: float = 0.01
    # Least part by which a decided effect reduces the errors on new samples.
    minimum_improvement: float = MINIMUM_IMPROVEMENT
    # Choose from these only; the whole catalogue when empty.
    effects: tuple[str, ...] = ()
    # By the name of the effect.
    tallies: dict[str, Tally] = field(default_factory=dict)
    # Candidates, the most of all looks.
    count: int = 0
    # Measurements that have been scored, stretches, and the length of these [s].
    samples: int = 0
    looks: int = 0
    seconds: float = 0.0

    @property
    def threshold(self) -> float:
        """log(m/α): log-evidence that decides."""
        return math.log(max(self.count, 1) / self.level)

    @property
    def logs(self) -> dict[str, float]:
        """Log-evidence by effect, the most first."""
        found = {name: tally.evidence.log for name, tally in self.tallies.items()}
        return dict(sorted(found.items(), key=lambda pair: -pair[1]))

    @property
    def decided(self) -> dict[str, Decision]:
        """Effects that have reached the threshold, the first to do so first."""
        found = {name: one.decided for name, one in self.tallies.items() if one.decided is not None}
        return dict(sorted(found.items(), key=lambda pair: pair[1].stamp))

    @property
    def doubtful(self) -> tuple[str, ...]:
        """Undecided effects with odds above 1/α to 1, for which more samples are needed."""
        sure = math.log(1.0 / self.level)
        return tuple(name for name, log in self.logs.items() if self.tallies[name].decided is None and log >= sure)

    def pending(self, name: str) -> str:
        """Why an effect whose evidence is above the threshold is not decided; empty for others."""
        tally = self.tallies[name]
        evidence = tally.evidence
        if tally.decided is not None or evidence.log < self.threshold:
            return ""
        if not tally.enough:
            return "a second stretch of samples must confirm it"
        if not evidence.distinguishable:
            return "its windows scatter as much as they gain"
        return f"it reduces the errors by {100.0 * evidence.improvement:.2g} % only"

    def update(self, earlier: Sequence[Record], new: Record, stamp: int) -> LiveEvidence:
        """Score a stretch of new samples that ends at `stamp` [ns] by models that are fitted to the samples before it.

        Raises InputError where the balance of forces cannot be evaluated on the earlier samples, and IdloopError where
        the stretch is too short for windows as wide as the noise asks for.
        """
        estimation = prepare_estimation(self.model, earlier, "prediction")
        options = Options(self.level, self.minimum_improvement, self.effects or None)
        forms: dict[int, WeakForm] = {}
        parent = requested_force_fit(self.model, estimation, forms)
        step = ForceView(estimation, options, forms=forms).evaluate(parent)
        # Together with the earlier samples, which determine the usual commands.
        data = [*estimation.data, *prepare(self.model, [new], companions=earlier)]
        form = weak_form(parent.form.engine, data, parent.form.width)
        if form is None:
            seconds = 4 * parent.form.width * parent.form.sample_time
            raise IdloopError(
                f"a stretch of {new.duration:.3g} s is too short to be scored: {seconds:.3g} s are needed"
            )
        base, tallies = _of_the_last(form, step.parent), dict(self.tallies)
        for one in step.evaluated:
            if len(one.proposals) == 1:
                # New samples that cannot be evaluated are impossible by the model: their log-density is prohibitive.
                difference = np.nan_to_num(_of_the_last(form, one.fit) - base, nan=-700.0, neginf=-700.0)
                name = one.proposals[0].name
                tallies[name] = tallies.get(name, Tally()).scored(difference)
        found = replace(
            self,
            count=max(self.count, step.count),
            samples=self.samples + len(new.time),
            looks=self.looks + 1,
            seconds=self.seconds + new.duration,
        )
        for name, tally in tallies.items():
            evidence = tally.evidence
            shows = (
                evidence.log >= found.threshold
                and evidence.distinguishable
                and evidence.improvement >= self.minimum_improvement
            )
            if tally.decided is None and tally.enough and shows:
                tallies[name] = replace(tally, decided=Decision(stamp, found.samples))
        return replace(found, tallies=tallies)


def _of_the_last(form: WeakForm, fit: WeakFit) -> Array:
    """Log-density of the windows of a form's last record."""
    return fit.log_densities(form.with_engine(fit.form.engine))[form.starts[-2] :]
