"""Division of the data into training, validation and test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Division:
    """How the samples are shared out.

    Attributes
    ----------
    train, validation, test : float
        Shares; they add up to one.
    by : {"random", "blocks"}
        Single samples drawn at random, or one unbroken stretch of each experiment for each purpose, in this order.

    Raises
    ------
    InputError
        Shares that do not add up.
    """

    train: float = 0.70
    validation: float = 0.15
    test: float = 0.15
    by: Literal["random", "blocks"] = "random"

    def __post_init__(self) -> None:
        shares = (self.train, self.validation, self.test)
        if min(shares) < 0 or self.train <= 0 or abs(sum(shares) - 1.0) > 1e-9:
            raise InputError(f"shares {shares} of training, validation and test; they must add up to 1")
        if self.by not in {"random", "blocks"}:
            raise InputError(f"division by {self.by!r}; take 'random' or 'blocks'")


@dataclass(frozen=True, eq=False)
class Split:
    """Which samples serve what.

    Attributes
    ----------
    train, validation, test : ndarray of int
        Rows of the regressors of all experiments one after the other; an experiment's first row belongs to the
        first sample of which all regressors are known.
    """

    train: Indices
    validation: Indices
    test: Indices

    def purposes(self, rows: int) -> Indices:
        """0, 1 or 2 for each row, shape (rows,)."""
        purpose = np.zeros(rows, dtype=np.int64)
        purpose[self.validation], purpose[self.test] = 1, 2
        return purpose


def divide(division: Division, rows: Sequence[int], random: np.random.Generator) -> Split:
    """Share out the rows of several experiments.

    `rows`: of each experiment.
    """
    parts: tuple[list[Indices], list[Indices], list[Indices]] = ([], [], [])
    start = 0
    for count in [sum(rows)] if division.by == "random" else rows:
        order = random.permutation(count) if division.by == "random" else np.arange(count)
        validation, test = round(division.validation * count), round(division.test * count)
        edges = np.cumsum([count - validation - test, validation])
        for part, piece in zip(parts, np.split(order, edges), strict=True):
            part.append(np.sort(piece) + start)
        start += count
    return Split(*(np.concatenate(part).astype(np.int64) for part in parts))
