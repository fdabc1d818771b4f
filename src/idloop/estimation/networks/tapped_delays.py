"""Tapped delay lines: which past outputs and inputs a nonlinear ARX model looks at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TappedDelays:
    """Orders of a nonlinear ARX model, one number for all signals or one for each.

    The regressors of sample k are y(k - 1), ..., y(k - na) of each output and u(k - nk), ..., u(k - nk - nb + 1)
    of each input.

    Attributes
    ----------
    na : int or sequence of int
        Past samples of each output.
    nb : int or sequence of int
        Samples of each input.
    nk : int or sequence of int
        Delay of each input [samples]; 0 where the input acts within the sample.

    Raises
    ------
    InputError
        Negative orders.
    """

    na: int | Sequence[int] = 2
    nb: int | Sequence[int] = 2
    nk: int | Sequence[int] = 1

    def __post_init__(self) -> None:
        for name in ("na", "nb", "nk"):
            value = getattr(self, name)
            if any(one < 0 for one in ([value] if isinstance(value, int) else value)):
                raise InputError(f"{name} = {value}; numbers of delays cannot be negative")

    def taps(self, inputs: int, outputs: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Signal and lag of each regressor.

        Parameters
        ----------
        inputs, outputs : int
            Numbers of signals.

        Returns
        -------
        source : ndarray of int, shape (r,)
            Output 0 to p - 1, then inputs p to p + m - 1.
        lag : ndarray of int, shape (r,)
            [samples].

        Raises
        ------
        InputError
            Other numbers of signals than orders, or nothing to look at.
        """
        na, nb, nk = _each(self.na, outputs, "na"), _each(self.nb, inputs, "nb"), _each(self.nk, inputs, "nk")
        pairs = [(index, lag) for index, count in enumerate(na) for lag in range(1, count + 1)]
        pairs += [
            (outputs + index, lag)
            for index, (count, delay) in enumerate(zip(nb, nk, strict=True))
            for lag in range(delay, delay + count)
        ]
        if not pairs:
            raise InputError("na and nb are all zero; a model needs something to look at")
        source, lag = np.array(pairs, dtype=np.int64).T
        return np.ascontiguousarray(source), np.ascontiguousarray(lag)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {name: np.asarray(getattr(self, name)).tolist() for name in ("na", "nb", "nk")}


def regressors(source: NDArray[np.int64], lag: NDArray[np.int64], inputs: Array, outputs: Array) -> Array:
    """Regressors of one experiment from the first sample on for which all of them are known.

    `source`, `lag` (r,): of ``TappedDelays.taps``; `inputs`, `outputs` (N, m) and (N, p). Returns shape (N - longest
    lag, r).
    """
    first, p = int(np.max(lag)), outputs.shape[1]
    columns = [
        (outputs[:, one] if one < p else inputs[:, one - p])[first - back : len(outputs) - back]
        for one, back in zip(source, lag, strict=True)
    ]
    return np.column_stack(columns)


def _each(value: int | Sequence[int], signals: int, name: str) -> list[int]:
    several = [value] * signals if isinstance(value, int) else list(value)
    if len(several) != signals:
        raise InputError(f"{name} = {value} for {signals} signals; give one number, or one for each")
    return several
