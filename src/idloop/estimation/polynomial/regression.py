"""Linear regression on lagged signals: least squares in one pass over the record, and standard errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from idloop.arrays import Array, Mask
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear.least_squares import column_sizes, rows_in_blocks, solve, triangle
from idloop.estimation.polynomial.polynomials import Orders, Polynomials
from idloop.estimation.statistics.covariance import long_run_covariance

# Singular values of the unit-column regressors below this part of the largest are rounding.
_RANK = 1e-13
Focus = Literal["prediction", "simulation"]
Errors = Literal["white", "coloured"]
_MOST_ROWS = 50_000  # of scores; longer records are summed in stretches first


def lagged(signal: Array, lags: Sequence[int], first: int, last: int | None = None) -> Array:
    """Columns signal(t - lag) for t = first..last-1; what lies before the record is 0.

    `signal` (n,); `lags`: 0 or more [samples]; `first`, `last`: rows. Returns shape (last - first, number of lags).
    """
    stop = len(signal) if last is None else last
    columns = np.zeros((stop - first, len(lags)))
    for column, lag in enumerate(lags):
        start = max(first, lag)
        if start < stop:
            columns[start - first :, column] = signal[start - lag : stop - lag]
    return columns


@dataclass(frozen=True, eq=False)
class Solution:
    """Least-squares solution from a triangular factor."""

    coefficients: Array  # shape (k,): of smallest norm (in units of the columns) where the data leave some undetermined
    squares: float  # sum of squares that is left
    # Shape (k, r): W with W W^T the pseudo-inverse of the normal matrix: white errors of variance v have the covariance
    # v W W^T
    factor: Array
    undetermined: Mask  # shape (k,): which coefficients the data leave open


def solution(factor: Array) -> Solution:
    """Solve for the last column of a triangular factor from the others."""
    k = factor.shape[1] - 1
    inverse, undetermined = inverse_factor(factor[:k, :k])
    coefficients = solve(factor[:k, :k], factor[:k, k], _RANK * max(k, 1))
    left = factor[:k, k] - factor[:k, :k] @ coefficients
    return Solution(coefficients, float(left @ left + factor[k, k] ** 2), inverse, undetermined)


def inverse_factor(factor: Array) -> tuple[Array, Mask]:
    """W with W W^T the pseudo-inverse of R^T R, and which coordinates it leaves open."""
    scale = column_sizes(factor)
    _, values, right = np.linalg.svd(factor / scale, full_matrices=False)
    keep = values > _RANK * max(float(values[0]) if len(values) else 0.0, 1e-300) * max(factor.shape[1], 1)
    missing = np.linalg.norm(right[~keep], axis=0) if not np.all(keep) else np.zeros(factor.shape[1])
    return right[keep].T / values[keep] / scale[:, None], np.asarray(missing > 1e-6)


@dataclass(frozen=True, eq=False)
class Channel:
    """What one output's model reads of one experiment."""

    output: Array  # shape (n,)
    inputs: Array  # shape (n, m)


def channels(data: Sequence[SampledData], column: int) -> list[Channel]:
    """Signals of one output."""
    return [Channel(one.output[:, column], one.input) for one in data]


def first_row(orders: Orders) -> int:
    """First sample whose whole past is known."""
    reach = [nk + nb - 1 for nb, nk in zip(orders.nb, orders.nk, strict=True) if nb]
    return max([orders.na, *reach, 0])


def usable_rows(data: Sequence[Channel], orders: Orders) -> int:
    """Samples whose whole past is known."""
    return sum(max(len(c.output) - first_row(orders), 0) for c in data)


def regressors(channel: Channel, orders: Orders, first: int, last: int) -> Array:
    """Rows phi(t) with y(t) = phi(t)^T theta + e(t), t = first..last-1 (Ljung, 2nd ed., eq. 4.11)."""
    parts = [-lagged(channel.output, range(1, orders.na + 1), first, last)]
    for i, (nb, nk) in enumerate(zip(orders.nb, orders.nk, strict=True)):
        parts.append(lagged(channel.inputs[:, i], range(nk, nk + nb), first, last))
    return np.hstack(parts)


def regression_blocks(data: Sequence[Channel], orders: Orders, first: int) -> Iterator[Array]:
    """Rows [phi(t), y(t)] of all experiments, a stretch at a time."""
    for channel in data:
        for start, stop in rows_in_blocks(len(channel.output), first):
            yield np.hstack([regressors(channel, orders, start, stop), channel.output[start:stop, None]])


def least_squares(data: Sequence[Channel], orders: Orders) -> Solution:
    """ARX coefficients in the order of `Orders.names`."""
    first, rows = first_row(orders), usable_rows(data, orders)
    if rows <= orders.size:
        raise InputError(
            f"{rows} usable samples for {orders.size} coefficients and a longest lag of {first};"
            " record longer or lower the orders"
        )
    return solution(triangle(regression_blocks(data, orders, first)))


def check_inputs(data: Sequence[SampledData], orders: Orders) -> None:
    """Raise InputError for an input that a model needs and that never moves."""
    for i, name in enumerate(data[0].input_names):
        if orders.nb[i] and not any(np.any(one.input[:, i]) for one in data):
            raise InputError(f"{data[0].name}: input {name!r} is 0 throughout; leave it out (nb = 0) or excite it")
    for i, name in enumerate(data[0].output_names):
        if not any(np.ptp(one.output[:, i]) > 0.0 for one in data):
            raise InputError(f"{data[0].name}: output {name!r} never moves; leave it out or excite the plant")


def open_note(polynomials: Polynomials, undetermined: Mask) -> list[str]:
    """Note on coefficients that the data do not determine."""
    if not np.any(undetermined):
        return []
    names = ", ".join(n for n, is_open in zip(polynomials.names, undetermined, strict=True) if is_open)
    text = (
        f"{polynomials.output_name}: the data do not determine {names}: one of many equivalent solutions was taken;"
        " lower the orders or excite more richly"
    )
    return [text]


def residual_of(channel: Channel, orders: Orders, coefficients: Array, first: int) -> Array:
    """Equation errors y - phi^T theta from the row `first` on."""
    parts = [
        channel.output[start:stop] - regressors(channel, orders, start, stop) @ coefficients
        for start, stop in rows_in_blocks(len(channel.output), first)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def scores_of(channel: Channel, orders: Orders, solution: Solution, first: int) -> Array:
    """Regressors in coordinates of unit information, times the errors, shape (n, r)."""
    parts = []
    for start, stop in rows_in_blocks(len(channel.output), first):
        rows = regressors(channel, orders, start, stop)
        error = channel.output[start:stop] - rows @ solution.coefficients
        parts.append((rows @ solution.factor) * error[:, None])
    return np.vstack(parts) if parts else np.zeros((0, solution.factor.shape[1]))


def white_errors(factor: Array, variance: float, undetermined: Mask) -> Array:
    """Variance of the errors times the inverse of the information (Ljung, 2nd ed., eq. 9.42), shape (k, k)."""
    return _opened(variance * factor @ factor.T, undetermined)


def coloured_errors(factor: Array, scores: Sequence[Array], parameters: int, undetermined: Mask) -> Array:
    """Sandwich: holds when the errors are not white, as under a noise model that is too poor (eq. 9.11 to 9.17).

    `factor` (k, r): W with W W^T the inverse of the sum of psi psi^T; `scores` (n_i, r): psi(t)^T W e(t) of each
    experiment, or sums of them over `stretch` samples; `parameters`: numbers that were estimated, for the small-sample
    factor; `undetermined` (k,): coefficients that get NaN. Returns shape (k, k).
    """
    total = sum(len(part) for part in scores)
    stretch = max(1, total // _MOST_ROWS)
    # Sums over stretches have the same long-run covariance, at a fraction of the cost.
    summed = [np.add.reduceat(part, np.arange(0, len(part), stretch), axis=0) for part in scores]
    summed = [part for part in summed if len(part) > 3]
    if not summed or not factor.shape[1]:
        return _opened(np.full((factor.shape[0],) * 2, np.nan), undetermined)
    rows = sum(len(part) for part in summed)
    centre = long_run_covariance(summed) * rows * total / max(total - parameters, 1)
    return _opened(factor @ centre @ factor.T, undetermined)


def _opened(covariance: Array, undetermined: Mask) -> Array:
    covariance = 0.5 * (covariance + covariance.T)
    covariance[undetermined, :] = np.nan
    covariance[:, undetermined] = np.nan
    return covariance
