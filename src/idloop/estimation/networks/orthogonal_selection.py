"""Selection of columns by orthogonal least squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DEPENDENT = 1e-8  # what is left of a column's square when the chosen ones are taken out, below which it is theirs


def select(base: Array, candidates: Array, targets: Array, count: int) -> NDArray[np.int64]:
    """Candidates that explain most of what the base leaves over, one after the other.

    In each step the candidate is taken whose part orthogonal to all the chosen columns lowers the sum of squares
    most (Chen, Billings and Luo, Int. J. Control 50, 1989), over all targets together.

    `base` (n, b): columns that are in the model anyway; `candidates` (n, c): changed in place; `targets` (n, p);
    `count`: most candidates to take. Returns: in the order of their choice; fewer where the others depend on them.
    """
    basis = np.linalg.qr(base)[0]
    left = targets - basis @ (basis.T @ targets)
    size = np.sum(candidates**2, axis=0)
    for _ in range(2):
        # Twice, because candidates much like the base lose most of their digits the first time.
        candidates -= basis @ (basis.T @ candidates)
    open_ = np.ones(candidates.shape[1], dtype=bool)
    chosen: list[int] = []
    for _ in range(count):
        square = np.sum(candidates**2, axis=0)
        open_ &= square > _DEPENDENT * size
        if not np.any(open_):
            break
        gain = np.sum((candidates.T @ left) ** 2, axis=1) / np.where(open_, square, np.inf)
        best = int(np.argmax(gain))
        chosen.append(best)
        open_[best] = False
        unit = candidates[:, best] / np.sqrt(square[best])
        left = left - np.outer(unit, unit @ left)
        candidates -= np.outer(unit, unit @ candidates)
    return np.array(chosen, dtype=np.int64)
