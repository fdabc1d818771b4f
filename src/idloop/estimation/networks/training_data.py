"""What a network is trained on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCK = 1024  # samples whose slopes are held at a time: as many as the cache has room for


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Experiments and what each sample serves."""

    experiments: Sequence[tuple[Array, Array]]  # shapes (N, m) and (N, p)
    purpose: Indices  # 0, 1 or 2 (training, validation, test) for each row of the regressors of all experiments
    first: int  # first sample of each experiment that is predicted

    def pieces(self) -> Iterator[tuple[Array, Array, Indices]]:
        """Inputs, outputs and purposes of each experiment."""
        start = 0
        for inputs, outputs in self.experiments:
            stop = start + len(outputs) - self.first
            yield inputs, outputs, self.purpose[start:stop]
            start = stop
