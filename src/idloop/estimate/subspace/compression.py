"""All windows of a record in one small triangular factor: what every subspace method starts from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimate.sampled import SampledData, together
from idloop.estimate.subspace.projection import RANK_TOLERANCE

Array = NDArray[np.float64]

_SMALLEST_BLOCK = 4096  # windows that are taken in at once


@dataclass(frozen=True)
class Compression:
    """Square root of the second moments of all windows of `length` samples.

    Every projection of rows of a block Hankel matrix on other rows depends on its LQ factor alone
    (Van Overschee and De Moor, Subspace Identification for Linear Systems, 1996, chapter 6; paper of the
    torsion system, eq. 3.9 to 3.15). Signals are scaled to unit deviation.

    Attributes
    ----------
    factor : ndarray, shape (length (m + p), columns)
        L of the LQ decomposition, divided by the root of the number of windows; a row is one signal at one lag.
    length : int
        Samples in a window.
    windows : int
        Number of windows over all experiments.
    input_scale, output_scale : ndarray, shapes (m,), (p,)
        Deviation of each signal [input units, output units].
    experiments : tuple of SampledData
    """

    factor: Array
    length: int
    windows: int
    input_scale: Array
    output_scale: Array
    experiments: tuple[SampledData, ...]

    @property
    def inputs(self) -> int:
        """Number of commands."""
        return len(self.input_scale)

    @property
    def outputs(self) -> int:
        """Number of measurements."""
        return len(self.output_scale)

    @property
    def samples(self) -> int:
        """Samples of all experiments."""
        return sum(len(one) for one in self.experiments)

    def u(self, first: int, last: int) -> Array:
        """Rows of the inputs at lags `first` to `last - 1`, time by time."""
        return self._rows(first, last, slice(0, self.inputs))

    def y(self, first: int, last: int) -> Array:
        """Rows of the outputs at lags `first` to `last - 1`, time by time."""
        return self._rows(first, last, slice(self.inputs, None))

    def both(self, first: int, last: int) -> Array:
        """Rows of inputs and outputs at lags `first` to `last - 1`: (u, y) of one lag, then of the next."""
        return self._rows(first, last, slice(None))

    def excited(self) -> int:
        """Number of directions of the commands in a window that the data have."""
        values = np.linalg.svd(self.u(0, self.length), compute_uv=False)
        return int(np.sum(values > RANK_TOLERANCE * values[0]))

    def scaled(self) -> list[tuple[Array, Array]]:
        """Inputs and outputs of each experiment in the factor's units."""
        return [(one.input / self.input_scale, one.output / self.output_scale) for one in self.experiments]

    def _rows(self, first: int, last: int, signals: slice) -> Array:
        wide = self.inputs + self.outputs
        blocks = self.factor.reshape(self.length, wide, -1)[first:last, signals]
        return blocks.reshape(-1, self.factor.shape[1])


def compress(data: SampledData | Sequence[SampledData], length: int) -> Compression:
    """Take in every window of `length` samples, block by block: memory does not grow with the record.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
    length : int
        Samples in a window.

    Returns
    -------
    Compression

    Raises
    ------
    InputError
        A signal that never changes, commands that are multiples of each other, or fewer windows than rows.
    """
    experiments = together(data)
    input_scale = _deviations([one.input for one in experiments], experiments[0].input_names, experiments[0].name)
    output_scale = _deviations([one.output for one in experiments], experiments[0].output_names, experiments[0].name)
    wide = len(input_scale) + len(output_scale)
    rows = length * wide
    windows = sum(max(len(one) - length + 1, 0) for one in experiments)
    if windows < rows:
        raise InputError(
            f"{experiments[0].name}: {sum(len(one) for one in experiments)} samples are too few for windows of {length}"
            f" samples of {wide} signals; give more data or a shorter horizon"
        )
    factor = np.zeros((0, rows))
    for one in experiments:
        joint = np.hstack([one.input / input_scale, one.output / output_scale])
        if len(joint) < length:
            continue
        view = sliding_window_view(joint, length, axis=0)
        step = max(_SMALLEST_BLOCK, 2 * rows)
        for start in range(0, view.shape[0], step):
            block = view[start : start + step].transpose(0, 2, 1).reshape(-1, rows)
            factor = np.asarray(np.linalg.qr(np.vstack([factor, block]), mode="r"))
    found = Compression(
        np.asarray(factor.T / np.sqrt(windows)), length, windows, input_scale, output_scale, tuple(experiments)
    )
    if np.linalg.matrix_rank(found.u(0, 1), tol=1e-9) < found.inputs:
        raise InputError(
            f"{experiments[0].name}: {', '.join(experiments[0].input_names)} move together; excite them apart or"
            " leave one out"
        )
    return found


def check_excitation(compression: Compression) -> None:
    """Refuse windows longer than the commands can tell apart.

    Raises
    ------
    InputError
    """
    wanted, excited = compression.length * compression.inputs, compression.excited()
    if excited < wanted:
        first = compression.experiments[0]
        raise InputError(
            f"{first.name}: {', '.join(first.input_names)} excites {excited} of the {wanted} directions of"
            f" {compression.length} samples; give a richer and independent excitation or a horizon of at most"
            f" {excited // (2 * compression.inputs)}"
        )


def _deviations(signals: list[Array], names: tuple[str, ...], where: str) -> Array:
    count = sum(len(one) for one in signals)
    mean = sum(one.sum(axis=0) for one in signals) / count
    deviation = np.sqrt(sum(((one - mean) ** 2).sum(axis=0) for one in signals) / count)
    size = np.max([np.abs(one).max(axis=0) for one in signals], axis=0)
    still = deviation <= 1e-12 * size
    if np.any(still):
        raise InputError(f"{where}: {names[int(np.argmax(still))]} never changes; excite it or leave it out")
    return np.asarray(deviation)
