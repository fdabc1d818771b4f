"""What a network is trained on: regressors of tapped delays, their scales, and the division of the samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.networks.network import Network

_FLAT = 1e-13  # spread of a column over its mean that is rounding
Form = Literal["series-parallel", "parallel"]

BLOCK = 1024  # samples whose slopes are held at a time: as many as the cache has room for


def by_range(values: Array) -> tuple[Array, Array]:
    """Centre and half width of the range of each column; the half width of a constant column is 1."""
    low, high = np.min(values, axis=0), np.max(values, axis=0)
    width = 0.5 * (high - low)
    return 0.5 * (low + high), np.where(width > 0, width, 1.0)


def by_spread(values: Array) -> tuple[Array, Array]:
    """Mean and standard deviation of each column; the standard deviation of a constant column is given as 1."""
    center = np.mean(values, axis=0)
    width = np.std(values, axis=0)
    # Rounding of the mean makes a constant column seem to move.
    return center, np.where(width > _FLAT * np.abs(center), width, 1.0)


@dataclass(frozen=True)
class Division:
    """How the samples are shared out.

    Raises InputError: shares that do not add up.
    """

    # Shares; they add up to one
    train: float = 0.70
    validation: float = 0.15
    test: float = 0.15
    # Single samples drawn at random, or one unbroken stretch of each experiment for each purpose, in this order
    by: Literal["random", "blocks"] = "random"

    def __post_init__(self) -> None:
        shares = (self.train, self.validation, self.test)
        if min(shares) < 0 or self.train <= 0 or abs(sum(shares) - 1.0) > 1e-9:
            raise InputError(f"shares {shares} of training, validation and test; they must add up to 1")
        if self.by not in {"random", "blocks"}:
            raise InputError(f"division by {self.by!r}; take 'random' or 'blocks'")


@dataclass(frozen=True, eq=False)
class Split:
    """Which samples serve what."""

    # Rows of the regressors of all experiments one after the other; an experiment's first row belongs to the first
    # sample of which all regressors are known
    train: Integers
    validation: Integers
    test: Integers

    def purposes(self, rows: int) -> Integers:
        """0, 1 or 2 for each row, shape (rows,)."""
        purpose = np.zeros(rows, dtype=np.int64)
        purpose[self.validation], purpose[self.test] = 1, 2
        return purpose


def divide(division: Division, rows: Sequence[int], random: np.random.Generator) -> Split:
    """Share out the rows of several experiments."""
    parts: tuple[list[Integers], list[Integers], list[Integers]] = ([], [], [])
    start = 0
    for count in [sum(rows)] if division.by == "random" else rows:
        order = random.permutation(count) if division.by == "random" else np.arange(count)
        validation, test = round(division.validation * count), round(division.test * count)
        edges = np.cumsum([count - validation - test, validation])
        for part, piece in zip(parts, np.split(order, edges), strict=True):
            part.append(np.sort(piece) + start)
        start += count
    return Split(*(np.concatenate(part).astype(np.int64) for part in parts))


@dataclass(frozen=True)
class TappedDelays:
    """Orders of a nonlinear ARX model, one number for all signals or one for each.

    The regressors of sample k are y(k - 1), ..., y(k - na) of each output and u(k - nk), ..., u(k - nk - nb + 1)
    of each input.

    Raises InputError: negative orders.
    """

    na: int | Sequence[int] = 2  # past samples of each output
    nb: int | Sequence[int] = 2  # samples of each input
    nk: int | Sequence[int] = 1  # delay of each input [samples]; 0 where the input acts within the sample

    def __post_init__(self) -> None:
        for name in ("na", "nb", "nk"):
            value = getattr(self, name)
            if any(one < 0 for one in ([value] if isinstance(value, int) else value)):
                raise InputError(f"{name} = {value}; numbers of delays cannot be negative")

    def taps(self, inputs: int, outputs: int) -> tuple[Integers, Integers]:
        """Signal and lag of each regressor.

        `inputs`, `outputs`: numbers of signals. Returns `source` (r,): output 0 to p - 1, then inputs p to p + m - 1.
        Returns `lag` (r,): [samples]. Raises InputError: other numbers of signals than orders, or no regressor.
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


def regressors(source: Integers, lag: Integers, inputs: Array, outputs: Array) -> Array:
    """Regressors of one experiment from the first sample on for which all of them are known."""
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


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Experiments and what each sample serves."""

    experiments: Sequence[tuple[Array, Array]]  # shapes (N, m) and (N, p)
    purpose: Integers  # 0, 1 or 2 (training, validation, test) for each row of the regressors of all experiments
    first: int  # first sample of each experiment that is predicted

    def pieces(self) -> Iterator[tuple[Array, Array, Integers]]:
        """Inputs, outputs and purposes of each experiment."""
        start = 0
        for inputs, outputs in self.experiments:
            stop = start + len(outputs) - self.first
            yield inputs, outputs, self.purpose[start:stop]
            start = stop


@dataclass(frozen=True, eq=False)
class Preparation:
    """Training data with its regressors and scales."""

    experiments: list[SampledData]
    delays: TappedDelays
    source: Integers  # shape (r,): signal of each regressor
    lag: Integers
    split: Split
    data: TrainingData
    train: Array  # shape (n, r): regressors of the training samples
    output_center: Array  # shape (p,): middle and half range of the training outputs [output units]
    output_width: Array

    def network(
        self, center: Array, width: Array, kind: Integers, direction: Array, scale: Array, weight: Array
    ) -> Network:
        """A network of these units on the regressors, without a linear part yet."""
        p, r = len(weight), center.size
        return Network(
            self.source, self.lag, center, width, kind, direction, scale, weight, np.zeros(p), np.zeros((p, r)),
            self.output_center, self.output_width,
        )  # fmt: skip

    def targets(self) -> Array:
        """Scaled outputs of all rows, shape (rows, p)."""
        outputs = np.concatenate([outputs[self.data.first :] for _, outputs in self.data.experiments])
        return np.asarray((outputs - self.output_center) / self.output_width)

    def rows(self) -> Array:
        """Regressors of all rows, shape (rows, r)."""
        return np.concatenate([regressors(self.source, self.lag, u, y) for u, y in self.data.experiments])


def prepare(
    data: SampledData | Sequence[SampledData],
    delays: TappedDelays,
    division: Division,
    random: np.random.Generator,
    free: Callable[[int, int], int],
) -> Preparation:
    """Check the data, build its regressors and share out its samples."""
    several = together(data)
    source, lag = delays.taps(several[0].input.shape[1], several[0].output.shape[1])
    first = int(np.max(lag))
    for one in several:
        if len(one) <= first:
            raise InputError(f"{one.name}: {len(one)} samples do not fill delays of {first}; give a longer record")
    experiments = [(np.ascontiguousarray(one.input), np.ascontiguousarray(one.output)) for one in several]
    split = divide(division, [len(one) - first for one in several], random)
    p = several[0].output.shape[1]
    if split.train.size * p <= free(source.size, p):
        raise InputError(
            f"{several[0].name}: {split.train.size} training samples for a network of {free(source.size, p)} numbers;"
            " give more data or take fewer units and delays"
        )
    total = sum(len(one) - first for one in several)
    training = TrainingData(experiments, split.purposes(total), first)
    outputs = np.concatenate([outputs[first:] for _, outputs in experiments])[split.train]
    for column, name in zip(outputs.T, several[0].output_names, strict=True):
        if not np.ptp(column) > 0:
            raise InputError(f"{several[0].name}: {name} does not move; a model needs an output that moves")
    if not any(np.ptp(inputs) > 0 for inputs, _ in experiments):
        raise InputError(f"{several[0].name}: no command ever changes; excite the axis, nothing can be identified")
    center, width = by_range(outputs)
    rows = np.concatenate([regressors(source, lag, u, y) for u, y in experiments])[split.train]
    return Preparation(several, delays, source, lag, split, training, rows, center, width)
