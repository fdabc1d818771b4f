"""What each block of samples says about changes of parameters: score and information, to first order.

With innovations e and the slopes ψ of the prediction, both white and of unit variance, a block's score is Σ ψ e and
its information Σ ψ ψᵀ: the asymptotic local approach to change detection (Benveniste, Basseville and Moustakides,
IEEE Trans. Automatic Control 32, 1987). The slope of a watched parameter is that towards the growth that is to be
noticed, so that for this growth the likelihood ratio is exact and not only of first order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.criterion import InitialStates

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.monitoring.reference_observer import Lens
    from idloop.physics import Engine

Array = NDArray[np.float64]

# Part of a block that must have been measured.
_FULL = 0.8


@dataclass(frozen=True)
class Scores:
    """Scores of blocks in the order of time.

    Attributes
    ----------
    index : array of int, shape (b,)
        Which block on the grid of the record's clock: it spans ``index * length`` to ``(index + 1) * length`` [s].
    gradient : array, shape (b, k)
        Score of each parameter [1/unit].
    information : array, shape (b, k, k)
        Information [1/unit²].
    """

    index: NDArray[np.int64]
    gradient: Array
    information: Array

    def __len__(self) -> int:
        """Number of blocks."""
        return len(self.index)


@dataclass(frozen=True)
class Evident:
    """What blocks say about one parameter, whatever the others do.

    Attributes
    ----------
    gradient, information : array, shape (b,)
        Score [1/unit] and information [1/unit²].
    """

    gradient: Array
    information: Array


def block_scores(
    engine: Engine, lens: Lens, theta: Array, steps: Array, data: Data, length: float, origin: float = 0.0
) -> Scores:
    """Score and information of every whole block of a record.

    Parameters
    ----------
    engine : Engine
        With the k parameters free that are watched or may vary.
    lens : Lens
    theta, steps : array, shape (k,)
        Values, and the changes towards which slopes are taken.
    data : Data
    length : float
        Length of a block [s].
    origin : float
        Time of the grid's beginning on the record's clock [s].

    Returns
    -------
    Scores
        Blocks that were measured whole by a settled observer.
    """
    initial = InitialStates(engine, [data])

    def innovations(values: Array) -> Array:
        state = initial.state(initial.values, 0, values)
        return engine.predict(
            values,
            data.input_time,
            data.input,
            data.time,
            data.output,
            lens.gain,
            initial_state=state,
            conditions=data.conditions,
        )

    present = innovations(theta)
    moved = []
    for i, step in enumerate(steps):
        other = theta.copy()
        other[i] += step
        moved.append(innovations(other))
    # Half a sample early: a stamp that jitters about the edge of a block stays on one side.
    place = np.floor((data.time - origin + 0.5 * lens.sample_time) / length).astype(np.int64)
    first, count = int(place[0]), int(place[-1] - place[0]) + 1
    k = len(steps)
    gradient, information = np.zeros((count, k)), np.zeros((count, k, k))
    measured = np.zeros((len(lens.groups), count))
    for group in range(len(lens.groups)):
        rows = lens.settled(data, group)
        rows &= np.all([np.all(np.isfinite(e[:, list(lens.groups[group])]), axis=1) for e in (present, *moved)], axis=0)
        order = lens.whiteners[group].order
        where = place[rows][order:] - first
        if not len(where):
            continue
        error = lens.look(present, group, rows)
        slopes = [(error - lens.look(e, group, rows)) / step for e, step in zip(moved, steps, strict=True)]
        measured[group] = np.bincount(where, minlength=count)
        for i in range(k):
            gradient[:, i] += np.bincount(where, np.sum(slopes[i] * error, axis=1), minlength=count)
            for j in range(i + 1):
                both = np.bincount(where, np.sum(slopes[i] * slopes[j], axis=1), minlength=count)
                information[:, i, j] += both
                if i != j:
                    information[:, j, i] += both
    usual = np.maximum(np.max(measured, axis=1, keepdims=True, initial=0.0), 1.0)
    whole = np.all(measured >= _FULL * np.minimum(usual, length / lens.sample_time), axis=0)
    return Scores(np.flatnonzero(whole) + first, gradient[whole], information[whole])


def join(parts: Sequence[Scores]) -> Scores:
    """Scores of stretches that overlap, each block once.

    Parameters
    ----------
    parts : sequence of Scores
        In the order of time, at least one.
    """
    index = np.concatenate([part.index for part in parts])
    # Of a block that two stretches saw, the first knew it whole as well: its observer had settled for longer.
    _, first = np.unique(index, return_index=True)
    gradient = np.concatenate([part.gradient for part in parts])
    information = np.concatenate([part.information for part in parts])
    return Scores(index[first], gradient[first], information[first])


def evident(scores: Scores, parameter: int, sizes: Array) -> Evident:
    """Score and information of one parameter when all others may have changed in every block anew.

    The efficient score: what a change of the others could explain as well is taken out (Basseville and Nikiforov,
    1993, ch. 7.2.6). Where they explain all, nothing is left, and the block tells nothing.

    Parameters
    ----------
    scores : Scores
    parameter : int
        Its place among the k.
    sizes : array, shape (k,)
        Typical changes; none of the others is taken to have changed by more than about ten times this.
    """
    others = [i for i in range(scores.gradient.shape[1]) if i != parameter]
    own = scores.information[:, parameter, parameter]
    if not others or not len(scores):
        return Evident(scores.gradient[:, parameter], own)
    scale = sizes[others]
    cross = scores.information[:, parameter][:, others] * scale
    inner = scores.information[:, others][:, :, others] * np.outer(scale, scale) + 0.01 * np.eye(len(others))
    share = np.linalg.solve(inner, cross[:, :, None])[:, :, 0]
    gradient = scores.gradient[:, parameter] - np.sum(share * scores.gradient[:, others] * scale, axis=1)
    return Evident(gradient, np.maximum(own - np.sum(share * cross, axis=1), 0.0))
