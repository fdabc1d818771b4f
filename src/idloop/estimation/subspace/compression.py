"""All windows of a record in one small triangular factor: what every subspace method starts from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.subspace.correlations import news, triangular, window_moments
from idloop.estimation.subspace.projection import RANK_TOLERANCE

Array = NDArray[np.float64]

_SMALLEST_BLOCK = 4096  # windows that are factored at once
_BLOCK = 65536  # samples that are summed at once
# Squares carry half of the digits. A white noise of this variance, in those of the signals, hides what is lost of the
# smallest directions: 20 bits below the motion, less than any sensor's own.
_RIDGE = 1e-14
# Deviation of what is new in the last sample of a window, as a share, beside which that noise is nothing.
_SMALLEST_NEWS = 1e-4
_LEAST_EXCITED = 4  # directions of a command: two samples of past and of future
_SMALLEST_COMMAND = 1e-11  # variance of a direction of the commands beside which it is little


@dataclass(frozen=True)
class Compression:
    """Square root of the second moments of all windows of `length` samples.

    Every projection of rows of a block Hankel matrix on other rows depends on its LQ factor alone
    (Van Overschee and De Moor, Subspace Identification for Linear Systems, 1996, chapter 6; paper of the
    torsion system, eq. 3.9 to 3.15). Signals are scaled to unit deviation.

    `factor` (length (m + p), columns): L of the LQ decomposition, divided by the root of the number of windows; a row
    is one signal at one lag; `input_scale`, `output_scale` (m,), (p,): deviation of each signal [input units, output
    units].
    """

    factor: Array
    length: int  # samples in a window
    windows: int  # number of windows over all experiments
    input_scale: Array
    output_scale: Array
    experiments: tuple[SampledData, ...]
    squared: bool = False  # whether the factor comes from correlations, which carry half of the digits

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
        if self.squared:  # they were looked at before
            return self.length * self.inputs
        values = np.linalg.svd(self.u(0, self.length), compute_uv=False)
        return int(np.sum(values > RANK_TOLERANCE * values[0]))

    def scaled(self) -> list[tuple[Array, Array]]:
        """Inputs and outputs of each experiment in the factor's units."""
        return [(one.input / self.input_scale, one.output / self.output_scale) for one in self.experiments]

    def _rows(self, first: int, last: int, signals: slice) -> Array:
        wide = self.inputs + self.outputs
        blocks = self.factor.reshape(self.length, wide, -1)[first:last, signals]
        return blocks.reshape(-1, self.factor.shape[1])


def compress(data: SampledData | Sequence[SampledData], length: int, *, exact: bool = False) -> Compression:
    """Take in every window of `length` samples: memory does not grow with the record.

    The factor comes from the correlations of the signals, which the Hankel structure makes some fifty times cheaper.
    They carry half of the digits, so that data (almost) without noise, and those whose command leaves directions empty
    or follows from what was before, have their windows factored themselves, block by block.

    `length`: samples in a window; `exact`: factor the windows themselves in any case. Raises InputError: a signal that
    never changes, commands that are multiples of each other, or fewer windows than rows.
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
    long = [one for one in experiments if len(one) >= length]
    factor = None if exact else _from_correlations(long, length, input_scale, output_scale)
    squared = factor is not None
    if factor is None:
        factor = _from_windows(long, length, input_scale, output_scale)
    factor /= np.sqrt(windows)
    found = Compression(factor, length, windows, input_scale, output_scale, tuple(experiments), squared)
    if np.linalg.matrix_rank(found.u(0, 1), tol=1e-9) < found.inputs:
        raise InputError(
            f"{experiments[0].name}: {', '.join(experiments[0].input_names)} move together; excite them apart or"
            " leave one out"
        )
    return found


def _from_correlations(
    experiments: Sequence[SampledData], length: int, input_scale: Array, output_scale: Array
) -> Array | None:
    """Factor by way of the second moments; none where the data have too little noise or excitation for it."""
    m, wide = len(input_scale), len(input_scale) + len(output_scale)
    scale = np.tile(np.concatenate([input_scale, output_scale]), length)
    moments = np.sum([window_moments(one.input, one.output, length) for one in experiments], axis=0)
    moments /= np.outer(scale, scale)
    factor = triangular(moments, _RIDGE)
    if factor is None or np.min(news(factor)[-wide:]) < _SMALLEST_NEWS:
        return None
    commands = np.flatnonzero(np.arange(len(scale)) % wide < m)
    sizes = np.linalg.eigvalsh(moments[np.ix_(commands, commands)])
    return factor if sizes[0] > _SMALLEST_COMMAND * sizes[-1] else None


def _from_windows(experiments: Sequence[SampledData], length: int, input_scale: Array, output_scale: Array) -> Array:
    """Factor of the windows themselves, block by block."""
    rows = length * (len(input_scale) + len(output_scale))
    step = max(_SMALLEST_BLOCK, 2 * rows)
    factor = np.zeros((0, rows))
    for one in experiments:
        for start in range(0, len(one) - length + 1, step):
            part = slice(start, start + step + length - 1)
            joint = np.hstack([one.input[part] / input_scale, one.output[part] / output_scale])
            block = sliding_window_view(joint, length, axis=0).transpose(0, 2, 1).reshape(-1, rows)
            factor = np.asarray(np.linalg.qr(np.vstack([factor, block]), mode="r"))
    return np.asarray(factor.T.copy())


def check_excitation(compression: Compression) -> None:
    """Refuse windows longer than the commands can tell apart."""
    wanted, excited = compression.length * compression.inputs, compression.excited()
    if excited < wanted:
        first = compression.experiments[0]
        if excited < _LEAST_EXCITED * compression.inputs:
            raise not_exciting(compression, excited, _LEAST_EXCITED)
        raise InputError(
            f"{first.name}: {', '.join(first.input_names)} excites {excited} of the {wanted} directions of"
            f" {compression.length} samples; give a richer and independent excitation or a horizon of at most"
            f" {excited // (2 * compression.inputs)}"
        )


def not_exciting(compression: Compression, excited: int, needed: int) -> InputError:
    """Error for commands that are not persistently exciting of the order that a method needs.

    `excited`: directions of all commands that the data have; `needed`: of each command.
    """
    first, each = compression.experiments[0], excited // compression.inputs
    sine = " as a single sine is" if each == 2 else ""
    return InputError(
        f"{first.name}: {', '.join(first.input_names)} follows from its own past: it is persistently exciting of order"
        f" {each} only{sine}, and {needed} is needed here; excite more frequencies, by a multisine, a chirp or random"
        f" steps, or take oe of order {max(each // 2, 1)}"
    )


def _deviations(signals: list[Array], names: tuple[str, ...], where: str) -> Array:
    """Deviation of each signal, summed in blocks: no copy of the record is made."""
    blocks = [one[start : start + _BLOCK] for one in signals for start in range(0, len(one), _BLOCK)]
    count = sum(len(one) for one in signals)
    mean = sum(block.sum(axis=0) for block in blocks) / count
    deviation = np.sqrt(sum(((block - mean) ** 2).sum(axis=0) for block in blocks) / count)
    still = deviation <= 1e-12 * np.hypot(deviation, mean)
    if np.any(still):
        raise InputError(f"{where}: {names[int(np.argmax(still))]} never changes; excite it or leave it out")
    return np.asarray(deviation)
