"""How many states the data show: singular values, canonical correlations and what noise alone would give."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError


@dataclass(frozen=True, eq=False)
class OrderSelection:
    """Number of states and the evidence for it."""

    method: str  # subspace method
    horizon: int  # samples of past and of future
    singular_values: Array  # shape (r,): of the method's weighted projection
    correlations: Array  # shape (s,): canonical correlations between past and future, whatever the method's weights
    threshold: float  # correlation that unrelated past and future would hardly exceed
    order: int  # number of correlations above it, one at least


def significant(correlations: Array, past: int, future: int, windows: int) -> tuple[int, float]:
    """Order by the edge of the canonical correlations of unrelated data.

    `correlations`: largest first; `past`, `future`: numbers of rows of past and future; `windows`: columns of the
    Hankel matrix.

    Notes
    -----
    The largest correlation of unrelated white data tends to
    ``sqrt(s (1 - t)) + sqrt(t (1 - s))`` with s = past/windows and t = future/windows (Wachter, Ann. Statist. 8,
    1980). Neighbouring windows share samples and the past is finite, which raises the edge: twice the squared
    correlation is asked for.
    """
    s, t = min(past / windows, 1.0), min(future / windows, 1.0)
    edge = (np.sqrt(s * (1.0 - t)) + np.sqrt(t * (1.0 - s))) if s + t < 1.0 else 1.0
    threshold = min(np.sqrt(2.0) * edge, 1.0 - 1e-9)
    return max(int(np.sum(correlations > threshold)), 1), float(threshold)


def check_order(order: int | str, horizon: int, outputs: int) -> None:
    """Refuse an order that windows of this horizon cannot show."""
    largest = (horizon - 1) * outputs
    if isinstance(order, str):
        if order != "auto":
            raise InputError(f'order "{order}" is neither "auto" nor a number of states')
    elif not 1 <= order <= largest:
        raise InputError(
            f"order {order} with a horizon of {horizon} samples; give 1 to {largest} states or a longer horizon"
        )
