"""All windows of a record in one small triangular factor: what every subspace method starts from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.linear.least_squares import triangle
from idloop.estimation.subspace.projection import RANK_TOLERANCE

Array = NDArray[np.float64]
_SUMMED_AT_ONCE = 4096  # samples summed before they join the whole: short sums keep their digits
_SMALLEST_BLOCK = 4096  # windows that are factored at once
_BLOCK = 65536  # samples that are summed at once
# Squares carry half of the digits. A white noise of this variance, in those of the signals, covers what is lost of the
# smallest directions: 20 bits below the motion, less than any sensor's own.
_RIDGE = 1e-14
# Deviation of what is new in the last sample of a window, as a share, to which that noise is negligible.
_SMALLEST_INNOVATION = 1e-4
_LEAST_EXCITED = 4  # directions of a command: two samples of past and of future
_SMALLEST_COMMAND = 1e-11  # variance of a direction of the commands, relative to the largest, that counts as excited
_LONGEST = 60  # samples
_SHORTEST = 10
_ROWS_PER_WINDOW = 0.25  # share of the data that the regressors of the longest horizon may take up
_FLOOR = 1e-10  # deviation of an innovation that counts as none, in deviations of its output


@njit(cache=True, fastmath={"contract", "reassoc"})
def _lagged(flat: Array, wide: int, reach: int, count: int, total: Array) -> None:
    """Add the products of the first `count` samples with the windows that begin at them, four at a time."""
    t = 0
    while t + 4 <= count:
        base = flat[t * wide : t * wide + reach + 3 * wide]
        for i in range(wide):
            row = total[i]
            s0, s1, s2, s3 = base[i], base[wide + i], base[2 * wide + i], base[3 * wide + i]
            for j in range(reach):
                row[j] += s0 * base[j] + s1 * base[wide + j] + s2 * base[2 * wide + j] + s3 * base[3 * wide + j]
        t += 4
    while t < count:
        for i in range(wide):
            for j in range(reach):
                total[i, j] += flat[t * wide + i] * flat[t * wide + j]
        t += 1


def window_moments(inputs: Array, outputs: Array, length: int) -> Array:
    """Sum of the outer products of all windows of two sets of signals.

    The block Hankel matrix repeats each sample `length` times, and so do the products of its rows: those of lag i with
    lag j and those of the two next lags differ by the first and the last sample alone. The first block of rows is
    therefore all that has to be summed (as SLICOT's IB01MD does; Sima, Sima and Van Huffel, J. Comput. Appl. Math. 170,
    2004).
    """
    samples, wide = len(outputs), inputs.shape[1] + outputs.shape[1]
    windows, rows = samples - length + 1, length * wide

    def joint(first: int, last: int) -> Array:
        return np.hstack([inputs[first:last], outputs[first:last]]).ravel()

    whole = np.zeros((rows, rows))
    for start in range(0, windows, _SUMMED_AT_ONCE):
        count = min(_SUMMED_AT_ONCE, windows - start)
        part = np.zeros((wide, rows))
        _lagged(joint(start, start + count + length - 1), wide, rows, count, part)
        whole[:wide] += part
    whole[:, :wide] = whole[:wide].T
    # What leaves and what enters as both windows move on by one sample, all lags at once.
    leaves, enters = joint(0, length - 1), joint(windows, samples)
    for lag in range(1, length):
        row, before = slice(lag * wide, (lag + 1) * wide), slice((lag - 1) * wide, lag * wide)
        change = np.outer(enters[before], enters) - np.outer(leaves[before], leaves)
        whole[row, wide:] = whole[before, :-wide] + change
    return whole


def triangular(moments: Array, ridge: float = 0.0) -> Array | None:
    """Lower triangular square root, or none where the moments are too nearly singular to have one, shape (r, r)."""
    size = np.sqrt(np.diagonal(moments))
    if not np.all(size > 0.0):
        return None
    scaled = moments / np.outer(size, size)
    scaled[np.diag_indices_from(scaled)] += ridge
    try:
        return np.asarray(np.linalg.cholesky(scaled) * size[:, None])
    except np.linalg.LinAlgError:
        return None


def innovation_sizes(factor: Array) -> Array:
    """Deviation of each row that the rows above it do not explain, as a share of its own."""
    return np.asarray(np.abs(np.diagonal(factor)) / np.linalg.norm(factor, axis=1))


@dataclass(frozen=True)
class Compression:
    """Square root of the second moments of all windows of `length` samples.

    Every projection of rows of a block Hankel matrix on other rows depends on its LQ factor alone
    (Van Overschee and De Moor, Subspace Identification for Linear Systems, 1996, chapter 6; paper of the
    torsion system, eq. 3.9 to 3.15). Signals are scaled to unit deviation.
    """

    # Shape (length (m + p), columns): L of the LQ decomposition, divided by the root of the number of windows; a row is
    # one signal at one lag
    factor: Array
    length: int  # samples in a window
    windows: int  # number of windows over all experiments
    input_scale: Array  # shape (m,): deviation of each signal [input units]
    output_scale: Array  # shape (p,): [output units]
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
        if self.squared:  # they were checked before
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
    if factor is None or np.min(innovation_sizes(factor)[-wide:]) < _SMALLEST_INNOVATION:
        return None
    commands = np.flatnonzero(np.arange(len(scale)) % wide < m)
    sizes = np.linalg.eigvalsh(moments[np.ix_(commands, commands)])
    return factor if sizes[0] > _SMALLEST_COMMAND * sizes[-1] else None


def _from_windows(experiments: Sequence[SampledData], length: int, input_scale: Array, output_scale: Array) -> Array:
    """Factor of the windows themselves, block by block."""
    rows = length * (len(input_scale) + len(output_scale))
    step = max(_SMALLEST_BLOCK, 2 * rows)

    def blocks() -> Iterator[Array]:
        for one in experiments:
            for start in range(0, len(one) - length + 1, step):
                part = slice(start, start + step + length - 1)
                joint = np.hstack([one.input[part] / input_scale, one.output[part] / output_scale])
                yield sliding_window_view(joint, length, axis=0).transpose(0, 2, 1).reshape(-1, rows)

    return np.asarray(triangle(blocks()).T.copy())


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
    """Error for commands that are not persistently exciting of the order that a method needs."""
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


def default_horizon(
    data: SampledData | Sequence[SampledData], order: int | None = None, feedthrough: bool = False
) -> int:
    """Length of past and future: the order of the best long ARX model by Akaike's criterion.

    That choice lets the neglected past vanish as the data grow (Larimore, Proc. ACC 1983; Bauer, Automatica 41,
    2005, section 5). It is never below 10 samples nor below the order and two more, and at most 60.

    `order`: number of states, where it is known; `feedthrough`: whether the command of a sample acts on its own
    measurement. Returns: [samples]. Raises InputError: too few samples.
    """
    experiments = together(data)
    wide = experiments[0].input.shape[1] + experiments[0].output.shape[1]
    samples = sum(len(one) for one in experiments)
    room = int(_ROWS_PER_WINDOW * samples / (2 * wide))
    shortest = max(_SHORTEST, 0 if order is None else order + 2)
    if room < 3:
        raise InputError(
            f"{experiments[0].name}: {samples} samples of {wide} signals are too few for a subspace method;"
            " record for longer"
        )
    longest = min(_LONGEST, room, min(len(one) for one in experiments) // 4)
    longest = max(longest, 2)
    return int(np.clip(_arx_order(compress(experiments, longest + 1), feedthrough), min(shortest, longest), longest))


def halved_windows(
    data: SampledData | Sequence[SampledData],
    horizon: int | None,
    order: int | None,
    feedthrough: bool,
    exact: bool = False,
) -> Compression:
    """Windows of past and future of one length: the user's, or the longest by the rule that the commands excite."""
    if horizon is not None:
        if horizon < 2:
            raise InputError(f"horizon of {horizon} samples; give at least 2")
        return compress(data, 2 * horizon, exact=exact)
    found = compress(data, 2 * default_horizon(data, order, feedthrough), exact=exact)
    excited = found.excited()
    shown = excited // (2 * found.inputs)
    least = 1 + (1 if order is None else -(-order // found.outputs))
    if 2 * shown < found.length and shown < least:
        raise not_exciting(found, excited, 2 * least)
    # Narrow excitation: it is persistent for shorter windows where it is not for long ones.
    return found if 2 * shown >= found.length else compress(data, 2 * max(shown, 2), exact=exact)


def _arx_order(compression: Compression, feedthrough: bool) -> int:
    """Lags that minimise AIC of y(k) on the past of both signals."""
    longest, outputs = compression.length - 1, compression.outputs
    target = compression.y(longest, longest + 1)
    # Newest lag first: the regressors of a shorter model are the first rows of those of a longer one.
    past = np.concatenate([compression.both(lag, lag + 1) for lag in range(longest - 1, -1, -1)])
    present = compression.u(longest, longest + 1) if feedthrough else target[:0]
    rotated, _ = np.linalg.qr(np.concatenate([present, past, target]).T)
    parts = target @ rotated
    wide = past.shape[0] // longest
    best, chosen = np.inf, 1
    for lags in range(1, longest + 1):
        rest = parts[:, len(present) + lags * wide :]
        covariance = rest @ rest.T + _FLOOR**2 * np.eye(outputs)
        criterion = compression.windows * np.linalg.slogdet(covariance)[1] + 2.0 * lags * wide * outputs
        if criterion < best:
            best, chosen = criterion, lags
    return chosen
