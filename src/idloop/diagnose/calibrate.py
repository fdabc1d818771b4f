"""How large the best of a whole catalogue comes out by chance: the null distribution of the maximum.

Most effects sit on a bound of their parameters and are tried at several values, so no
table of the chi-squared distribution holds. Under the null hypothesis the whitened errors
are white: random errors are projected on the same traces, and the largest statistic of
each draw is noted (a parametric bootstrap of the score test; Hansen, Econometrica 64, 1996).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.screen import Screened

Array = NDArray[np.float64]

DRAWS = 4000


@dataclass(frozen=True)
class Null:
    """Statistics under the null hypothesis.

    Attributes
    ----------
    largest : array, shape (DRAWS,)
        Largest statistic over the catalogue, sorted.
    own : dict
        Largest statistic of each proposal by itself, sorted, by name.
    """

    largest: Array
    own: dict[str, Array]

    def p_value(self, statistic: float) -> float:
        """Probability that the best of the catalogue does as well by chance (family-wise)."""
        return exceedance(self.largest, statistic)

    def threshold(self, level: float) -> float:
        """Statistic that the best of the catalogue exceeds with this probability."""
        return float(np.quantile(self.largest, 1.0 - level))

    def own_threshold(self, name: str, level: float) -> float:
        """Statistic that one proposal alone exceeds with this probability."""
        return float(np.quantile(self.own[name], 1.0 - level)) if name in self.own else 0.0


def exceedance(draws: Array, statistic: float) -> float:
    """Share of sorted draws at or above a statistic; beyond them an exponential tail.

    Twice a log-likelihood ratio has a tail no heavier than exp(−x/2), up to powers of x.
    """
    count = len(draws) - int(np.searchsorted(draws, statistic, side="left"))
    if count >= 20:
        return count / len(draws)
    anchor = float(draws[-20])
    return float(max(20.0 / len(draws) * np.exp(-0.5 * max(statistic - anchor, 0.0)), 1e-300))


def calibrate(screened: Sequence[Screened], seed: int) -> Null:
    """Draw the null distribution of all statistics of a screening.

    Parameters
    ----------
    screened : sequence of Screened
    seed : int

    Returns
    -------
    Null
    """
    sketches = [(i, t) for i, s in enumerate(screened) for t in s.traces if t.sketch.shape[1] > 0]
    if not sketches:
        return Null(np.zeros(DRAWS), {})
    columns = np.concatenate([t.sketch for _, t in sketches], axis=1)
    generator = np.random.default_rng(seed)
    gram = columns.T @ columns
    values, vectors = np.linalg.eigh(gram)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    scores = generator.normal(size=(DRAWS, len(root))) @ root.T
    largest = np.zeros(DRAWS)
    own: dict[str, Array] = {}
    column = 0
    for i, trace in sketches:
        width = trace.sketch.shape[1]
        part = scores[:, column : column + width]
        column += width
        statistic = np.sum(part**2, axis=1)
        if trace.one_sided:
            statistic = np.where(part[:, 0] > 0.0, statistic, 0.0)
        name = screened[i].proposal.name
        own[name] = np.maximum(own[name], statistic) if name in own else statistic
        np.maximum(largest, statistic, out=largest)
    return Null(np.sort(largest), {name: np.sort(draws) for name, draws in own.items()})
