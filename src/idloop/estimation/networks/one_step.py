"""Errors and slopes of a network of sigmoids one step ahead, where all samples can be taken at once.

Measured outputs take the place of the network's own, so that the regressors are the same in every epoch.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.networks.network import Network
from idloop.estimation.networks.tapped_delays import regressors
from idloop.estimation.networks.training_data import BLOCK, TrainingData

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OneStep:
    """Scaled regressors and outputs of all samples."""

    regressors: Array  # shape (n, r)
    outputs: Array  # shape (n, p)
    training: NDArray[np.bool_]  # shape (n,): samples that the slopes are wanted of

    @classmethod
    def of(cls, network: Network, data: TrainingData) -> OneStep:
        """Scaled once for a whole training."""
        skipped = data.first - int(np.max(network.lag))
        rows = [regressors(network.source, network.lag, i, o)[skipped:] for i, o, _ in data.pieces()]
        outputs = np.concatenate([outputs[data.first :] for _, outputs, _ in data.pieces()])
        scaled = (outputs - network.output_center) / network.output_width
        return cls((np.concatenate(rows) - network.center) / network.width, scaled, data.purpose == 0)

    def errors(self, network: Network) -> Array:
        """Scaled outputs less the network's, shape (n, p)."""
        return self.outputs - _outputs(network, self.regressors, _activations(network, self.regressors))

    def rows(self, network: Network, with_linear: bool) -> Iterator[Array]:
        """Blocks of the columns (slopes in the order of `parameters`, scaled error) of the training samples."""
        all_z, all_y = self.regressors[self.training], self.outputs[self.training]
        (h, d), p = network.direction.shape, len(network.constant)
        tail = h * d + h + p * h
        for begin in range(0, len(all_z), BLOCK):
            z, y = all_z[begin : begin + BLOCK], all_y[begin : begin + BLOCK]
            a = _activations(network, z)
            block = np.zeros((len(z), p, tail + p + (p * d if with_linear else 0) + 1))
            for i in range(p):
                inner = network.weight[i] * (1.0 - a * a)
                np.multiply(inner[:, :, None], z[:, None, :], out=block[:, i, : h * d].reshape(len(z), h, d))
                block[:, i, h * d : h * d + h] = inner
                block[:, i, h * d + h + i * h : h * d + h + (i + 1) * h] = a
                block[:, i, tail + i] = 1.0
                if with_linear:
                    block[:, i, tail + p + i * d : tail + p + (i + 1) * d] = z
            block[:, :, -1] = y - _outputs(network, z, a)
            yield block.reshape(len(z) * p, -1)


def _activations(network: Network, z: Array) -> Array:
    """Values of the units, shape (n, h)."""
    values = z @ network.direction.T
    values += network.scale
    return np.asarray(np.tanh(values, out=values))


def _outputs(network: Network, z: Array, values: Array) -> Array:
    """Scaled outputs, shape (n, p)."""
    return np.asarray(values @ network.weight.T + z @ network.linear.T + network.constant)
