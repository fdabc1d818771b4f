"""Which orders and delays an ARX model of the data should have."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.linear.least_squares import triangle
from idloop.estimation.polynomial.polynomials import Orders
from idloop.estimation.polynomial.regression import (
    Channel,
    Solution,
    channels,
    check_inputs,
    first_row,
    regression_blocks,
    solution,
    usable_rows,
)
from idloop.estimation.statistics.information_criteria import Information

Criterion = Literal["validation", "aic", "bic", "fpe", "loss"]
CRITERIA: tuple[Criterion, ...] = ("validation", "aic", "bic", "fpe", "loss")


@dataclass(frozen=True, eq=False)
class DelayEstimate:
    """Delays, and how much worse the others would be."""

    sample_time: float  # period [s]
    delay: tuple[int, ...]  # of each input [samples]
    candidates: Integers  # shape (k,): delays that were compared [samples]
    bic: Array  # shape (m, k): extended Bayesian information criterion of each, less the least

    @property
    def seconds(self) -> tuple[float, ...]:
        """Delays less the one sample that a sampled plant has anyway [s]."""
        return tuple(max(delay - 1, 0) * self.sample_time for delay in self.delay)


def estimate_delay(
    data: SampledData | Sequence[SampledData], *, longest: int = 20, shortest: int = 1, na: int = 10, nb: int = 10
) -> DelayEstimate:
    """Find the first lag of each input that a long ARX model cannot do without.

    Models with the lags nk to `longest` + `nb` - 1 of an input are nested; one QR factorisation gives the sums
    of squares of all, and the extended Bayesian information criterion (Chen and Chen, Biometrika 95, 2008)
    chooses, which allows for the many lags that are compared. A first coefficient that the noise hides
    counts to the delay.

    `data`: with one output; `longest`, `shortest`: delays to compare [samples]. Under feedback without delay keep
    `shortest` at 1: the command of a sample follows the measurement there; `na`, `nb`: order of the noise and plant
    that is allowed for. Raises InputError: more than one output, an empty range, or too few samples. References: Ljung,
    System Identification, 2nd ed., sections 16.4 and 17.3; Björklund and Ljung, IEEE CDC 2003.
    """
    experiments = together(data)
    if experiments[0].output.shape[1] != 1:
        raise InputError(f"{experiments[0].name}: choose one output, as data.outputs([0]), to estimate its delays")
    if not 0 <= shortest <= longest or nb < 1 or na < 0:
        raise InputError(
            f"delays {shortest} to {longest} with na = {na}, nb = {nb}; give 0 <= shortest <= longest, na >= 0, nb >= 1"
        )
    candidates, inputs = np.arange(shortest, longest + 1), range(experiments[0].input.shape[1])
    count, price = longest - shortest + nb, 2.0 * np.log(len(candidates))
    criteria = []
    for own in inputs:
        # The models leave out 0, 1, ... of the first lags of one input.
        gone = [[k if i == own else 0 for i in inputs] for k in range(len(candidates))]
        structures = [(na, [count - k for k in row], [shortest + k for k in row]) for row in gone]
        table = arx_structures(experiments, structures=structures)
        criteria.append(table.criterion("bic") + price * table.parameters)
    above = np.array(criteria) - np.min(criteria, axis=1, keepdims=True)
    best = tuple(int(candidates[np.argmin(row)]) for row in above)
    return DelayEstimate(experiments[0].sample_time, best, candidates, above)


@dataclass(frozen=True, eq=False)
class ArxStructures:
    """Losses of ARX models of several structures, all on the same rows."""

    structures: tuple[Orders, ...]
    loss: Array  # shape (s,): mean squared prediction error on the data that it was fitted to [output unit squared]
    validation_loss: Array | None  # shape (s,): on the validation data
    samples: int  # rows of the fit

    @property
    def parameters(self) -> Integers:
        """Number of coefficients of each structure."""
        return np.array([o.size for o in self.structures])

    def criterion(self, name: Criterion) -> Array:
        """Value of a criterion of `Information`, or of the validation loss, for each structure; the least is the best.

        BIC is also Rissanen's MDL (Ljung, System Identification, 2nd ed., section 16.4). Raises InputError for another
        name, or validation without validation data.
        """
        if name == "validation":
            if self.validation_loss is None:
                raise InputError("no validation data were given; give them, or choose by 'bic', 'aic' or 'fpe'")
            return self.validation_loss
        if name not in CRITERIA:
            raise InputError(f"criterion {name!r} is unknown; choose one of {', '.join(CRITERIA)}")
        sizes = zip(self.loss, self.parameters, strict=True)
        return np.array([getattr(Information(float(loss), int(d), self.samples), name) for loss, d in sizes])


def arx_structures(
    data: SampledData | Sequence[SampledData],
    na: int | Iterable[int] = range(1, 9),
    nb: int | Iterable[int | tuple[int, ...]] = range(1, 9),
    nk: int | Iterable[int | tuple[int, ...]] = 1,
    *,
    validation: SampledData | Sequence[SampledData] | None = None,
    structures: Iterable[tuple[int, int | Sequence[int], int | Sequence[int]]] | None = None,
) -> ArxStructures:
    """Fit ARX models of many structures and tabulate their losses.

    The record is factored once; each structure then costs a factorisation of its few columns alone. All are
    fitted to the same rows, so that their losses compare.

    `data`: with one output; `na`, `nb`, `nk`: numbers to combine; an entry of nb or nk may be a tuple with one number
    per input; `validation`: on which the models are judged; `structures`: in the place of all combinations. Raises
    InputError: more than one output, no structures, or too few samples for the largest. References: Ljung, System
    Identification, 2nd ed., section 16.4; the table is that of arxstruc.
    """
    experiments = together(data)
    judged = [] if validation is None else together([experiments[0], *together(validation)])[1:]
    if experiments[0].output.shape[1] != 1:
        raise InputError(
            f"{experiments[0].name}: {experiments[0].output.shape[1]} outputs; choose orders for one at a time,"
            " as data.outputs([0])"
        )
    m = experiments[0].input.shape[1]
    listed = structures if structures is not None else product(_several(na), _several(nb), _several(nk))
    orders = tuple(Orders.of(m, na=a, nb=b, nk=k) for a, b, k in listed)
    if not orders:
        raise InputError("no structures to compare; give at least one of na, nb and nk each")
    every = covering(orders)
    check_inputs(experiments, every)
    for side in filter(None, (experiments, judged)):
        rows = usable_rows(channels(side, 0), every)
        if rows <= every.size:
            raise InputError(
                f"{side[0].name}: {rows} usable samples for the largest structure of {every.size} coefficients and a"
                f" longest lag of {first_row(every)}; record longer or lower the orders"
            )
    factor, samples = factored(channels(experiments, 0), every)
    other = factored(channels(judged, 0), every) if judged else None
    loss, judgement = np.empty(len(orders)), np.empty(len(orders))
    for index, one in enumerate(orders):
        fitted = fit(factor, one, every)
        loss[index] = fitted.squares / samples
        if other is not None:
            left = other[0][:, _columns(one, every)] @ np.append(-fitted.coefficients, 1.0)
            judgement[index] = float(left @ left) / other[1]
    return ArxStructures(orders, loss, judgement if other is not None else None, samples)


def select_order(table: ArxStructures, criterion: Criterion | None = None) -> Orders:
    """Choose the structure of the least criterion, of equals the smaller.

    `criterion`: validation where there are validation data, else BIC, which finds the true order as records grow
    ("validation", "bic", "aic", "fpe" or "loss"). Returns: for ``arx(data, orders.na, orders.nb, orders.nk)``. Raises
    InputError: an unknown criterion, or validation without validation data.
    """
    name: Criterion = criterion or ("validation" if table.validation_loss is not None else "bic")
    values = table.criterion(name)
    sizes = table.parameters
    return table.structures[min(range(len(values)), key=lambda i: (float(values[i]), int(sizes[i])))]


def _several(value: Any) -> list[Any]:
    return [value] if isinstance(value, int) else list(value)


def covering(orders: Sequence[Orders]) -> Orders:
    """The smallest structure that holds all columns of the others."""
    m = orders[0].inputs
    begin, end = [0] * m, [0] * m
    for i in range(m):
        used = [o for o in orders if o.nb[i]]
        begin[i] = min((o.nk[i] for o in used), default=0)
        end[i] = max((o.nk[i] + o.nb[i] for o in used), default=0)
    nb = tuple(e - b for b, e in zip(begin, end, strict=True))
    return Orders(max(o.na for o in orders), nb, 0, 0, (0,) * m, tuple(begin))


def factored(signals: Sequence[Channel], every: Orders) -> tuple[Array, int]:
    """Triangular factor of the rows of a structure, and their number."""
    return triangle(regression_blocks(signals, every, first_row(every))), usable_rows(signals, every)


def fit(factor: Array, orders: Orders, every: Orders) -> Solution:
    """Least squares of a structure from the factor of one that holds its columns."""
    return solution(triangle([factor[:, _columns(orders, every)]]))


def _columns(orders: Orders, every: Orders) -> list[int]:
    """Places of a structure's coefficients, and of the target, in the factor."""
    columns = [*range(orders.na)]
    for i in range(orders.inputs):
        if orders.nb[i]:
            first = every.b(i).start + orders.nk[i] - every.nk[i]
            columns += range(first, first + orders.nb[i])
    return [*columns, every.size]
