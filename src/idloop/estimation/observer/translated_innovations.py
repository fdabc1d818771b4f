"""Innovations of one observer from those of another, without a simulation of the model.

Two observers of one model and the same measurements differ by a state that follows the linear part of the model, so
that the innovations of one are filtered innovations of the other: exactly for a linear model, else to first order in
the difference of the observers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.estimation.criterion import Errors

if TYPE_CHECKING:
    from idloop.estimation.observer.innovations import InnovationCriterion

Array = NDArray[np.float64]

# Pauses in the measurements count as at most this [samples].
_LONGEST_PAUSE = 1000


class TranslatedCriterion:
    """Innovations of a criterion for any disturbance, translated from those for one disturbance.

    `criterion`: tuned for the parameters `theta` (k,), which stay; `nuisance` (2,): exponent and memory of the
    disturbance of the simulation.
    """

    name = "prediction"
    whiten = True

    def __init__(self, criterion: InnovationCriterion, theta: Array, nuisance: Array) -> None:
        self.criterion = criterion
        linear = criterion.linear
        self._output = np.ascontiguousarray(linear.C)
        self._known = []
        for r, d in enumerate(criterion.data):
            pause = np.rint(np.diff(d.time, prepend=d.time[0]) / d.sample_time).astype(np.int64)
            self._known.append((
                criterion.innovation(theta, nuisance, r),
                criterion.observer(nuisance, r),
                criterion.decay(float(nuisance[1]), r),
                *_motion(linear.A, linear.G, d.sample_time),
                np.clip(pause, 1, _LONGEST_PAUSE),
            ))  # fmt: skip

    def retune(self, theta: Array) -> None:
        """The linear part stays that of the simulation."""

    def nuisance(self) -> tuple[Array, Array, Array, Array]:
        """As `InnovationCriterion.nuisance`."""
        return self.criterion.nuisance()

    def keep(self, nuisance: Array) -> None:
        """As `InnovationCriterion.keep`."""
        self.criterion.keep(nuisance)

    def errors(self, theta: Array, nuisance: Array) -> Errors:
        """As `InnovationCriterion.errors`; ``theta`` is not used."""
        return self.criterion.arranged([self._innovation(nuisance, r) for r in range(len(self._known))], nuisance)

    def _innovation(self, nuisance: Array, record: int) -> Array:
        known, observer, decay, transition, push, pause = self._known[record]
        other = self.criterion.observer(nuisance, record)
        found = np.empty_like(known)
        _translate(
            known, observer.gains, observer.place, decay, other.gains, other.place,
            self.criterion.decay(float(nuisance[1]), record), transition, push, self._output, pause, found,
        )  # fmt: skip
        return found


def _motion(a: Array, g: Array, step: float) -> tuple[Array, Array]:
    """Transition of the state over one sample, shape (m, m), and its response to a held force, shape (m,)."""
    # Imported on first use, for a quick start of the command line.
    from scipy.linalg import expm

    m = len(a)
    augmented = np.zeros((m + 1, m + 1))
    augmented[:m, :m], augmented[:m, m] = a, np.ravel(g)
    moved = expm(augmented * step)
    return np.ascontiguousarray(moved[:m, :m]), np.ascontiguousarray(moved[:m, m])


@njit(cache=True, nogil=True)
def _translate(
    known: Any, gains: Any, place: Any, decay: float, other_gains: Any, other_place: Any, other_decay: float,
    transition: Any, push: Any, output: Any, pause: Any, found: Any,
) -> None:  # fmt: skip
    """Innovations ``found`` with the other gains, from those ``known`` with the first."""
    n, p = known.shape
    m = transition.shape[0]
    last, other_last = place.shape[0] - 1, other_place.shape[0] - 1
    apart, moved = np.zeros(m), np.zeros(m)
    force = other_force = 0.0
    for k in range(n):
        if k > 0:
            for _ in range(pause[k]):
                for i in range(m):
                    total = push[i] * (other_force - force)
                    for j in range(m):
                        total += transition[i, j] * apart[j]
                    moved[i] = total
                for i in range(m):
                    apart[i] = moved[i]
        force *= decay
        other_force *= other_decay
        gain, other_gain = gains[place[min(k, last)]], other_gains[other_place[min(k, other_last)]]
        for q in range(p):
            error = known[k, q]
            for i in range(m):
                error -= output[q, i] * apart[i]
            found[k, q] = error
        for q in range(p):
            here, there = known[k, q], found[k, q]
            if np.isnan(here):
                continue
            for i in range(m):
                apart[i] += other_gain[i, q] * there - gain[i, q] * here
            force += gain[m, q] * here
            other_force += other_gain[m, q] * there
