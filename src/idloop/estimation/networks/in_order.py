"""Errors and slopes of any network, one sample after another: in a free run each waits for those before."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.networks.network import Network, ahead, parameters, slopes
from idloop.estimation.networks.training_data import BLOCK, TrainingData

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class InOrder:
    """A network on the samples of some experiments."""

    data: TrainingData
    parallel: bool  # whether the network runs freely (parallel form) or predicts one step ahead (series-parallel form)

    def errors(self, network: Network) -> Array:
        """Measured outputs less the network's, scaled, shape (n, p)."""
        found = []
        for inputs, outputs, _ in self.data.pieces():
            with np.errstate(over="ignore", invalid="ignore"):
                error = (outputs - self._modelled(network, inputs, outputs)) / network.output_width
            found.append(error[self.data.first :])
        return np.concatenate(found)

    def rows(self, network: Network, with_linear: bool) -> Iterator[Array]:
        """Blocks of the columns (slopes in the order of `parameters`, scaled error) of the training samples."""
        p, size = len(network.constant), parameters(network, with_linear).size
        for inputs, outputs, purpose in self.data.pieces():
            modelled = self._modelled(network, inputs, outputs)
            errors = (outputs - modelled) / network.output_width
            carry = np.zeros((max(self.data.first, 1), p, size))
            for begin in range(self.data.first, len(outputs), BLOCK):
                end = min(begin + BLOCK, len(outputs))
                past = modelled if self.parallel else outputs
                found = slopes(network, with_linear, inputs, past, begin, end, carry, self.parallel)
                used = purpose[begin - self.data.first : end - self.data.first] == 0
                yield np.column_stack([found[used].reshape(-1, size), errors[begin:end][used].ravel()])

    def _modelled(self, network: Network, inputs: Array, outputs: Array) -> Array:
        free = np.full(len(network.constant), np.inf)
        steps = len(outputs) if self.parallel else 1
        return np.asarray(ahead(network, inputs, outputs, self.data.first, steps, -free, free))
