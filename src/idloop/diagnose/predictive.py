"""Evidence for an effect: what models with and without it say of samples that their fits have not seen.

The records are dealt into folds of stretches that interleave. Each fold is scored by fits on all others
(cross-validation: Stone, JRSS B 36, 1974); the sum of the differences of their log-densities is the log-evidence

    log E = Σ_folds [log p_c(fold | fitted on the others) - log p_0(fold | fitted on the others)].

Nothing is maximised on the samples that judge, whatever the effect's shape or bounds. Where folds are scored by earlier
ones only, P(E of any of m effects ≥ m/α) ≤ α where nothing is missing (Wasserman, Ramdas and Balakrishnan, PNAS 117,
2020); with all others the same threshold is kept, and docs/diagnosis.md counts how often it is passed. Where the errors
are coloured or model error rules, the densities are tempered by how much more the sums over stretches vary than
independent samples would.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from idloop.estimate.weak_fit import WeakFit
from idloop.estimate.weak_form import BLOCKS

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

# Each fold is scored by a fit on the others: with more of them fits cost more, with fewer they know less.
FOLDS = 4
# A difference of two scores is told from none beyond so many standard deviations, a chance of one in twenty (Vuong,
# Econometrica 57, 1989).
DEVIATIONS = 1.645


def deal(starts: NDArray[np.int64]) -> tuple[list[Rows], list[Rows]]:
    """Deal the rows of some records into folds of stretches that interleave.

    Parameters
    ----------
    starts : array of int, shape (records + 1,)
        First row of each record, and the number of all.

    Returns
    -------
    folds : list of array of int
    blocks : list of array of int
        Stretches of the folds that are scored, in the order of their rows' places among these.
    """
    total = int(starts[-1])
    folds: list[list[Rows]] = [[] for _ in range(FOLDS)]
    parts: list[Rows] = []
    few = 0
    for first, last in pairwise(starts):
        count = max(round(BLOCKS * (last - first) / total), 1)
        for index, part in enumerate(np.array_split(np.arange(first, last), count)):
            # How a record begins is in the first fold; short records take turns.
            place = (index if count >= FOLDS else few) % FOLDS
            few += count < FOLDS
            folds[place].append(part)
            parts.append(part)
    joined = [np.sort(np.concatenate(fold or [np.zeros(0, dtype=np.int64)])) for fold in folds]
    rows = np.empty(total, dtype=np.int64)
    order = np.concatenate(joined)
    rows[order] = np.arange(len(order))
    return joined, [rows[part] for part in parts]


@dataclass(frozen=True)
class Scores:
    """What a model says of samples that its fits have not seen.

    Attributes
    ----------
    log_density : array, shape (n,)
        Of every sample of the folds that are scored.
    blocks : list of array of int
        Stretches of them.
    start : float
        Log-density of how the records begin, where the samples do not count it: one event, which has no stretches.
    """

    log_density: Array
    blocks: list[Rows]
    start: float = 0.0

    def against(self, other: Scores) -> Evidence:
        """Evidence for this model against another one."""
        difference = self.log_density - other.log_density
        sums = np.array([float(np.sum(difference[block])) for block in self.blocks])
        lengths = np.array([len(block) for block in self.blocks], dtype=float)
        return evidence_of(sums, lengths, float(np.sum(difference**2)), self.start - other.start)


@dataclass(frozen=True)
class Evidence:
    """For one model against another.

    Attributes
    ----------
    difference : float
        Of the log-densities of samples not seen.
    design_effect : float
        How much more it varies than with independent samples, at least 1.
    spread : float
        Its standard deviation.
    samples : int
    start : float
        Of the log-densities of how the records begin.
    """

    difference: float
    design_effect: float
    spread: float
    samples: int
    start: float = 0.0

    @property
    def log(self) -> float:
        """Log-evidence, tempered."""
        return self.difference / self.design_effect + self.start

    @property
    def sure(self) -> float:
        """What is beyond doubt of the difference: all but so many of its deviations."""
        return self.difference + self.start - DEVIATIONS * self.spread

    @property
    def improvement(self) -> float:
        """Part by which errors on samples not seen become smaller, at most 1."""
        return float(1.0 - np.exp(-self.difference / max(self.samples, 1)))

    @property
    def told(self) -> bool:
        """Whether the difference stands above its own spread."""
        return self.sure > 0.0

    def p_value(self, candidates: int) -> float:
        """Probability that the best of so many candidates has such evidence where nothing is missing, at most 1."""
        return float(min(1.0, candidates * np.exp(-min(max(self.log, 0.0), 700.0))))


def evidence_of(sums: Array, lengths: Array, squares: float, start: float = 0.0) -> Evidence:
    """Evidence by what is known of stretches.

    Parameters
    ----------
    sums : array, shape (stretches,)
        Of the differences of the log-densities over each stretch.
    lengths : array, shape (stretches,)
        Samples in each.
    squares : float
        Sum of the squared differences of all samples.
    start : float
        As of `Evidence`.

    Returns
    -------
    Evidence
    """
    total, samples = float(np.sum(sums)), float(np.sum(lengths))
    mean = total / max(samples, 1.0)
    alone = squares - mean * total
    together = float(np.sum((sums - mean * lengths) ** 2))
    design_effect = max(together / max(alone, 1e-300), 1.0)
    return Evidence(total, design_effect, float(np.sqrt(together)), int(samples), start)


def scores_of(fit: WeakFit) -> Scores:
    """Scores of a model that was fitted by its force balance to all rows.

    Parameters
    ----------
    fit : WeakFit
        Around which the fits on the other folds are linearised.

    Returns
    -------
    Scores
    """
    folds, blocks = deal(fit.form.starts)
    found = []
    for index in range(FOLDS):
        others = np.sort(np.concatenate([fold for place, fold in enumerate(folds) if place != index]))
        found.append(fit.refitted(others).log_densities()[folds[index]])
    return Scores(np.concatenate(found), blocks)


def seen_scores(fit: WeakFit) -> Scores:
    """Scores of a model as it is, for all rows: of values that most of these rows had no part in.

    Parameters
    ----------
    fit : WeakFit

    Returns
    -------
    Scores
    """
    folds, blocks = deal(fit.form.starts)
    return Scores(fit.log_densities()[np.concatenate(folds)], blocks)
