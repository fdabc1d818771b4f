"""From experiments to what a network is trained on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.networks.model import NarxModel
from idloop.estimation.networks.network import Network
from idloop.estimation.networks.training import TrainingHistory
from idloop.estimation.networks.training_data import (
    Division,
    Split,
    TappedDelays,
    TrainingData,
    by_range,
    divide,
    regressors,
)

Form = Literal["series-parallel", "parallel"]

_RANGES = 50.0  # a free run that leaves so many times the range of the training data has diverged


@dataclass(frozen=True, eq=False)
class Preparation:
    """Training data with its regressors and scales.

    `source`, `lag` (r,): of the regressors; `output_center`, `output_width` (p,): middle and half range of the outputs
    of the training samples [output units].
    """

    experiments: list[SampledData]
    delays: TappedDelays
    source: Integers
    lag: Integers
    split: Split
    data: TrainingData
    train: Array  # shape (n, r): regressors of the training samples
    output_center: Array
    output_width: Array

    def targets(self) -> Array:
        """Scaled outputs of all rows, shape (rows, p)."""
        outputs = np.concatenate([outputs[self.data.first :] for _, outputs in self.data.experiments])
        return np.asarray((outputs - self.output_center) / self.output_width)

    def rows(self) -> Array:
        """Regressors of all rows, shape (rows, r)."""
        return np.concatenate([regressors(self.source, self.lag, u, y) for u, y in self.data.experiments])

    def model(
        self, method: str, network: Network, history: TrainingHistory, form: Form, notes: tuple[str, ...]
    ) -> NarxModel:
        """The finished model."""
        return NarxModel(
            method=method,
            form=form,
            delays=self.delays,
            network=network,
            low=self.output_center - _RANGES * 2 * self.output_width,
            high=self.output_center + _RANGES * 2 * self.output_width,
            samples=self.split.train.size,
            split=self.split,
            history=history,
            notes=notes,
            **self.experiments[0].labels,
        )


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
