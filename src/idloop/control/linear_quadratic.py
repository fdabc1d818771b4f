"""Gains of a linear-quadratic regulator, by python-control."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array
from idloop.errors import InputError


def linear_quadratic_gains(
    a: ArrayLike,
    b: Sequence[float],
    q: Sequence[float],
    r: float,
    sample_time: float | None,
    where: str = "controller",
) -> Array:
    """Gains K of law = -K x that minimise the sum of x' diag(q) x + r law².

    `a` (n, n): state matrix of the continuous model. `b`: input matrix of the continuous model. `q`: state weights.
    `r`: command weight. `sample_time`: seconds: design for the model sampled with the command held; None: continuous
    design. `where`: place named at the start of the error line. Returns shape (n,). Raises InputError: no stabilising
    solution exists.
    """
    from scipy.signal import cont2discrete

    import control

    A = np.asarray(a, dtype=np.float64)
    B = np.asarray(b, dtype=np.float64).reshape(-1, 1)
    Q, R = np.diag(q), np.array([[r]])
    try:
        if sample_time is None:
            gains, _, poles = control.lqr(A, B, Q, R)
            stable = bool(np.all(np.real(poles) < 0.0))
        else:
            F, G, *_ = cont2discrete((A, B, np.eye(A.shape[0]), np.zeros_like(B)), sample_time)
            gains, _, poles = control.dlqr(F, G, Q, R)
            stable = bool(np.all(np.abs(poles) < 1.0))
    # python-control raises whatever its back end does: ControlException, LinAlgError or ValueError.
    except Exception as error:
        raise InputError(_unsolved(where)) from error
    if not stable or not np.all(np.isfinite(gains)):
        raise InputError(_unsolved(where))
    return np.asarray(gains, dtype=np.float64).ravel()


def _unsolved(where: str) -> str:
    return (
        f"{where}: the linear-quadratic design has no stabilising solution; check that model.b "
        "reaches every unstable state of model.a and that q weighs it"
    )
