"""Evidence for an effect: the likelihood of unseen samples by models with and without it.

The records are dealt into folds of stretches that interleave. Each fold is scored by fits on all others
(cross-validation: Stone, JRSS B 36, 1974); the sum of the differences of their log-densities is the log-evidence

    log E = Σ_folds [log p_c(fold | fitted on the others) - log p_0(fold | fitted on the others)].

Nothing is maximised on the samples that are scored, whatever the effect's shape or bounds. Where folds are scored by
earlier ones only, P(E of any of m effects ≥ m/α) ≤ α where nothing is missing (Wasserman, Ramdas and Balakrishnan, PNAS
117, 2020); with all others the same threshold is kept, and docs/explanation/diagnosis.md counts how often it is passed.
Where errors are coloured or model error dominates, the densities are tempered by how much more the sums over stretches
vary than those of independent samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.force_balance.weak_fit import WeakFit
from idloop.estimation.force_balance.weak_form import BLOCKS

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

# Folds; more of them cost more fits, and with fewer each fit has fewer samples.
FOLDS = 4
# Normal deviate beyond which 5 % lie: models are distinguishable where their scores differ by more (Vuong, Econometrica
# 57, 1989).
DEVIATIONS = 1.645


def deal(starts: Rows) -> tuple[list[Rows], list[Rows]]:
    """Rows of some records in folds of stretches that interleave, and the stretches by their rows' places in these.

    `starts` is the first row of each record, and the number of all.
    """
    total = int(starts[-1])
    folds: list[list[Rows]] = [[] for _ in range(FOLDS)]
    parts: list[Rows] = []
    few = 0
    for first, last in pairwise(starts):
        count = max(round(BLOCKS * (last - first) / total), 1)
        for index, part in enumerate(np.array_split(np.arange(first, last), count)):
            # The beginning of a record is in the first fold; short records take turns.
            place = (index if count >= FOLDS else few) % FOLDS
            few += count < FOLDS
            folds[place].append(part)
            parts.append(part)
    joined = [np.sort(np.concatenate(fold or [np.zeros(0, dtype=np.int64)])) for fold in folds]
    rows = np.empty(total, dtype=np.int64)
    rows[np.concatenate(joined)] = np.arange(total)
    return joined, [rows[part] for part in parts]


def others(folds: Sequence[Rows], index: int) -> Rows:
    """Rows of all folds but one."""
    return np.concatenate([fold for place, fold in enumerate(folds) if place != index])


@dataclass(frozen=True)
class Scores:
    """Log-density of every sample by fits that have not seen it, and stretches of these samples."""

    log_density: Array
    blocks: list[Rows]
    # Of the initial states, where the samples do not contain it.
    start: float = 0.0

    def against(self, other: Scores) -> Evidence:
        """Evidence for this model against another one."""
        difference = self.log_density - other.log_density
        sums = np.array([float(np.sum(difference[block])) for block in self.blocks])
        lengths = np.array([len(block) for block in self.blocks], dtype=float)
        return evidence_of(sums, lengths, float(np.sum(difference**2)), self.start - other.start)


@dataclass(frozen=True)
class Course:
    """Log-evidence after each stretch of the data, in the order of time and of the records."""

    samples: tuple[int, ...]  # scored until then
    log_e: tuple[float, ...]

    def decided(self, threshold: float) -> int | None:
        """The place from which on the log-evidence stays at a threshold or above; None where it ends below."""
        below = [place for place, value in enumerate(self.log_e) if value < threshold]
        place = below[-1] + 1 if below else 0
        return place if place < len(self.log_e) else None

    def less(self, choices: float) -> Course:
        """As read against the threshold of one effect, where as many more choices (their logarithm) were made."""
        return Course(self.samples, tuple(value - choices for value in self.log_e))


@dataclass(frozen=True)
class Evidence:
    """For one model against another: the difference of the log-densities of unseen samples."""

    difference: float
    # How much more it varies than with independent samples, at least 1.
    design_effect: float
    # Its standard deviation.
    spread: float
    samples: int
    # Of the log-densities of the initial states.
    start: float = 0.0
    # How it has grown over the stretches.
    course: Course = Course((), ())

    @property
    def log(self) -> float:
        """Log-evidence, tempered."""
        return self.difference / self.design_effect + self.start

    @property
    def improvement(self) -> float:
        """Part by which the errors on unseen samples are reduced, at most 1."""
        return float(1.0 - np.exp(-self.difference / max(self.samples, 1)))

    @property
    def distinguishable(self) -> bool:
        """Whether the difference exceeds its own spread."""
        return self.difference + self.start - DEVIATIONS * self.spread > 0.0

    def p_value(self, candidates: int) -> float:
        """Probability that the best of so many candidates has such evidence where nothing is missing, at most 1."""
        return float(min(1.0, candidates * np.exp(-min(max(self.log, 0.0), 700.0))))


def evidence_of(sums: Array, lengths: Array, squares: float, start: float = 0.0) -> Evidence:
    """Evidence by the sums of the differences over stretches, their lengths, and the sum of all squared differences."""
    total, samples = float(np.sum(sums)), float(np.sum(lengths))
    mean = total / max(samples, 1.0)
    alone = squares - mean * total
    together = float(np.sum((sums - mean * lengths) ** 2))
    design_effect = max(together / max(alone, 1e-300), 1.0)
    grown = np.cumsum(sums) / design_effect + start
    course = Course(tuple(np.cumsum(lengths).astype(int).tolist()), tuple(grown.tolist()))
    return Evidence(total, design_effect, float(np.sqrt(together)), int(samples), start, course)


def scores_of(fit: WeakFit) -> Scores:
    """Scores of a model fitted by its force balance; the fits to the other folds begin with its slopes."""
    folds, blocks = deal(fit.form.starts)
    found = [fit.refitted(np.sort(others(folds, index))).log_densities()[fold] for index, fold in enumerate(folds)]
    return Scores(np.concatenate(found), blocks)


def scores_without_refit(fit: WeakFit) -> Scores:
    """Scores of a model without refits, for values that most of the rows had no part in."""
    folds, blocks = deal(fit.form.starts)
    return Scores(fit.log_densities()[np.concatenate(folds)], blocks)
