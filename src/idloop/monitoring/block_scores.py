"""Score and information of each block of samples about changes of parameters, to first order.

With innovations e and the slopes ψ of the prediction, both white and of unit variance, a block's score is Σ ψ e and
its information is Σ ψ ψᵀ: the asymptotic local approach to change detection (Benveniste, Basseville and Moustakides,
IEEE Trans. Automatic Control 32, 1987). The slope of a watched parameter is the difference quotient
over the growth to detect, so that the likelihood ratio of this growth is exact and not only of first order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array, Integers
from idloop.estimation.criterion import InitialStates

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.monitoring.reference_observer import ReferenceObserver
    from idloop.physics import Engine


# Least share of a block that must be measured.
_FULL = 0.8


@dataclass(frozen=True)
class Scores:
    """Scores of blocks in the order of time."""

    # shape (b,): number of each block on the grid of the record's clock, from ``index * length`` to ``(index + 1) *
    # length`` [s]
    index: Integers
    gradient: Array  # shape (b, k): score of each parameter [1/unit]
    information: Array  # shape (b, k, k): information [1/unit²]

    def __len__(self) -> int:
        """Number of blocks."""
        return len(self.index)


@dataclass(frozen=True)
class EfficientScore:
    """Score of one parameter per block, independent of changes of the others."""

    # shape (b,): score [1/unit] and information [1/unit²]
    gradient: Array
    information: Array


def block_scores(
    engine: Engine,
    observer: ReferenceObserver,
    theta: Array,
    steps: Array,
    data: Data,
    length: float,
    origin: float = 0.0,
) -> Scores:
    """Score and information of every whole block of a record.

    `engine`: its k free parameters are those that are watched or may vary; `theta`, `steps` (k,): values, and the steps
    of the difference quotients; `length`: length of a block [s]; `origin`: origin of the grid on the record's clock
    [s]. Returns: of the blocks that are measured completely, after the observer has settled.
    """
    initial = InitialStates(engine, [data])

    def innovations(values: Array) -> Array:
        state = initial.state(initial.values, 0, values)
        signals = (data.input_time, data.input, data.time, data.output)
        return engine.predict(values, *signals, observer.gain, initial_state=state, conditions=data.conditions)

    present = innovations(theta)
    moved = [innovations(theta + change) for change in np.diag(steps)]
    # Half a sample early, so that a stamp that jitters about the edge of a block stays on one side.
    place = np.floor((data.time - origin + 0.5 * observer.sample_time) / length).astype(np.int64)
    first, count = int(place[0]), int(place[-1] - place[0]) + 1
    k = len(steps)
    gradient, information = np.zeros((count, k)), np.zeros((count, k, k))
    measured = np.zeros((len(observer.groups), count))
    for group in range(len(observer.groups)):
        rows = observer.settled(data, group)
        rows &= np.all(
            [np.all(np.isfinite(e[:, list(observer.groups[group])]), axis=1) for e in (present, *moved)], axis=0
        )
        order = observer.whiteners[group].order
        where = place[rows][order:] - first
        if not len(where):
            continue
        error = observer.whitened(present, group, rows)
        slopes = [(error - observer.whitened(e, group, rows)) / step for e, step in zip(moved, steps, strict=True)]
        measured[group] = np.bincount(where, minlength=count)
        for i in range(k):
            gradient[:, i] += np.bincount(where, np.sum(slopes[i] * error, axis=1), minlength=count)
            for j in range(k):
                information[:, i, j] += np.bincount(where, np.sum(slopes[i] * slopes[j], axis=1), minlength=count)
    usual = np.maximum(np.max(measured, axis=1, keepdims=True, initial=0.0), 1.0)
    whole = np.all(measured >= _FULL * np.minimum(usual, length / observer.sample_time), axis=0)
    return Scores(np.flatnonzero(whole) + first, gradient[whole], information[whole])


def join(parts: Sequence[Scores]) -> Scores:
    """Scores of overlapping stretches, each block once.

    `parts`: in the order of time, at least one.
    """
    index, gradient, information = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("index", "gradient", "information")
    )
    # A block in two stretches is taken from the first, whose observer has settled for longer.
    first = np.unique(index, return_index=True)[1]
    return Scores(index[first], gradient[first], information[first])


def efficient_score(scores: Scores, parameter: int, sizes: Array) -> EfficientScore:
    """Efficient score of one parameter: what changes of the other parameters explain is projected out.

    See Basseville and Nikiforov, 1993, ch. 7.2.6. The others may change in each block.

    `parameter`: its index among the k. `sizes` (k,): typical changes; changes of the others are assumed to be below
    about ten times these.
    """
    others = [i for i in range(scores.gradient.shape[1]) if i != parameter]
    own = scores.information[:, parameter, parameter]
    if not others or not len(scores):
        return EfficientScore(scores.gradient[:, parameter], own)
    scale = sizes[others]
    cross = scores.information[:, parameter][:, others] * scale
    inner = scores.information[:, others][:, :, others] * np.outer(scale, scale) + 0.01 * np.eye(len(others))
    share = np.linalg.solve(inner, cross[:, :, None])[:, :, 0]
    gradient = scores.gradient[:, parameter] - np.sum(share * scores.gradient[:, others] * scale, axis=1)
    return EfficientScore(gradient, np.maximum(own - np.sum(share * cross, axis=1), 0.0))
