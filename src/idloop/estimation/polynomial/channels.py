"""Signals of one output as rows of a regression, and the least squares on them that all families share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.polynomial.orders import Orders
from idloop.estimation.polynomial.polynomials import Polynomials
from idloop.estimation.polynomial.regression import Solution, lagged, rows_in_blocks, solve, triangle

Array = NDArray[np.float64]
Initial = Literal["estimate", "zero"]
Focus = Literal["prediction", "simulation"]
Errors = Literal["white", "coloured"]


@dataclass(frozen=True, eq=False)
class Channel:
    """What one output's model reads of one experiment."""

    output: Array  # shape (n,)
    inputs: Array  # shape (n, m)


def channels(data: Sequence[SampledData], column: int, coupled: bool = False) -> list[Channel]:
    """Signals of one output; of a coupled model the other outputs count as inputs."""
    others = [i for i in range(data[0].output.shape[1]) if i != column] if coupled else []
    return [Channel(one.output[:, column], np.hstack([one.input, one.output[:, others]])) for one in data]


def first_row(orders: Orders, initial: Initial) -> int:
    """First sample whose whole past is known, or 0 for signals that were zero before the record."""
    if initial == "zero":
        return 0
    reach = [nk + nb - 1 for nb, nk in zip(orders.nb, orders.nk, strict=True) if nb]
    return max([orders.na, *reach, 0])


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


def least_squares(data: Sequence[Channel], orders: Orders, initial: Initial = "estimate") -> Solution:
    """ARX coefficients in the order of `Orders.names`.

    Raises InputError: fewer rows than coefficients.
    """
    first = first_row(orders, initial)
    rows = sum(max(len(c.output) - first, 0) for c in data)
    if rows <= orders.size:
        raise InputError(
            f"{rows} usable samples for {orders.size} coefficients and a longest lag of {first};"
            " record longer or lower the orders"
        )
    return solve(triangle(regression_blocks(data, orders, first)))


def check_inputs(data: Sequence[SampledData], orders: Orders) -> None:
    """Raise InputError for an input that a model needs and that never moves."""
    for i, name in enumerate(data[0].input_names):
        if orders.nb[i] and not any(np.any(one.input[:, i]) for one in data):
            raise InputError(f"{data[0].name}: input {name!r} is 0 throughout; leave it out (nb = 0) or excite it")
    for i, name in enumerate(data[0].output_names):
        if not any(np.ptp(one.output[:, i]) > 0.0 for one in data):
            raise InputError(f"{data[0].name}: output {name!r} never moves; leave it out or excite the plant")


def open_note(polynomials: Polynomials, undetermined: NDArray[np.bool_]) -> list[str]:
    """What to tell of coefficients that the data leave open."""
    if not np.any(undetermined):
        return []
    names = ", ".join(n for n, is_open in zip(polynomials.names, undetermined, strict=True) if is_open)
    text = (
        f"{polynomials.output_name}: the data cannot tell {names} apart, one of many equal choices was taken;"
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
