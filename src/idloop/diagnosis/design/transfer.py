"""From the innovations of one observer to those of another one, without running the model again.

Both observers belong to the same linear model, so their innovations are two filterings of one difference
between measurement and free run.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


def transfer(innovations: Array, transition: Array, output: Array, given: Array, wanted: Array) -> Array:
    """Innovations that another observer would have.

    Parameters
    ----------
    innovations : ndarray (n, p, k)
        Of the given observer, k series at once; NaN where not measured.
    transition : ndarray (m, m)
        Over one sample, the disturbance force included.
    output : ndarray (p, m)
    given, wanted : ndarray (s m, p)
        Gains one below the other, the last held; as of `time_varying_observer`.
    """
    return np.asarray(
        _transfer(
            np.ascontiguousarray(innovations, dtype=float),
            np.ascontiguousarray(transition, dtype=float),
            np.ascontiguousarray(output, dtype=float),
            np.ascontiguousarray(given, dtype=float),
            np.ascontiguousarray(wanted, dtype=float),
        )
    )


@njit(cache=True, nogil=True, fastmath=False)
def _transfer(innovations: Any, transition: Any, output: Any, given: Any, wanted: Any) -> Any:
    n, p, series = innovations.shape
    m = transition.shape[0]
    last_given, last_wanted = given.shape[0] // m - 1, wanted.shape[0] // m - 1
    found = np.empty_like(innovations)
    # Difference between the states of the two observers, for every series.
    apart = np.zeros((m, series))
    moved = np.zeros((m, series))
    for t in range(n):
        at_given, at_wanted = m * min(t, last_given), m * min(t, last_wanted)
        for j in range(p):
            for s in range(series):
                value = innovations[t, j, s]
                for i in range(m):
                    value += output[j, i] * apart[i, s]
                found[t, j, s] = value
        for j in range(p):
            if np.isnan(innovations[t, j, 0]):
                continue
            for i in range(m):
                one, other = given[at_given + i, j], wanted[at_wanted + i, j]
                for s in range(series):
                    apart[i, s] += one * innovations[t, j, s] - other * found[t, j, s]
        for i in range(m):
            for s in range(series):
                moved[i, s] = 0.0
            for q in range(m):
                factor = transition[i, q]
                if factor != 0.0:
                    for s in range(series):
                        moved[i, s] += factor * apart[q, s]
        apart, moved = moved, apart
    return found
