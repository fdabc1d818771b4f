"""The delay of each input: the first lag at which it matters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.polynomial.channels import channels, check_inputs, first_row, regression_blocks
from idloop.estimation.polynomial.orders import Orders
from idloop.estimation.polynomial.regression import triangle

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DelayEstimate:
    """Delays, and how much worse the others would be.

    Attributes
    ----------
    sample_time : float
        Period [s].
    delay : tuple of int
        Of each input [samples].
    candidates : ndarray of int, shape (k,)
        Delays that were compared [samples].
    bic : ndarray, shape (m, k)
        Extended Bayesian information criterion of each, less the least.
    """

    output_name: str
    input_names: tuple[str, ...]
    sample_time: float
    delay: tuple[int, ...]
    candidates: NDArray[np.int64]
    bic: Array

    @property
    def seconds(self) -> tuple[float, ...]:
        """Delays less the one sample that a sampled plant has anyway [s]."""
        return tuple(max(delay - 1, 0) * self.sample_time for delay in self.delay)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "output": self.output_name,
            "inputs": list(self.input_names),
            "sample_time": self.sample_time,
            "delay": list(self.delay),
            "seconds": list(self.seconds),
            "candidates": self.candidates,
            "bic": self.bic,
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw the criterion over the delay; returns the matplotlib axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(figsize=(7, 3), layout="constrained")
            for index, (name, values) in enumerate(zip(self.input_names, self.bic, strict=True)):
                axes.plot(self.candidates, values, marker=".", label=name, **drawing.model_look(index))
                axes.axvline(self.delay[index], color=drawing.BAND, linewidth=0.6)
            axes.set_yscale("symlog")
            axes.set_ylim(bottom=0.0)
            axes.xaxis.get_major_locator().set_params(integer=True)
            axes.set_xlabel(drawing.label("delay", "samples"))
            axes.set_ylabel(drawing.label("extended BIC above the least", None))
            axes.set_title(f"delay to {self.output_name}")
            axes.legend()
        return axes


def estimate_delay(
    data: SampledData | Sequence[SampledData],
    *,
    longest: int = 20,
    shortest: int = 1,
    na: int = 10,
    nb: int = 10,
) -> DelayEstimate:
    """Find the first lag of each input that a long ARX model cannot do without.

    Models with the lags nk to `longest` + `nb` - 1 of an input are nested; one QR factorisation gives the sums
    of squares of all, and the extended Bayesian information criterion (Chen and Chen, Biometrika 95, 2008)
    chooses, which knows that many lags were looked at. A first coefficient that the noise hides
    counts to the delay.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        With one output.
    longest, shortest : int
        Delays to compare [samples]. Under feedback without delay keep `shortest` at 1: the command of a sample
        follows the measurement there.
    na, nb : int
        Order of the noise and plant that is allowed for.

    Returns
    -------
    DelayEstimate

    Raises
    ------
    InputError
        More than one output, an empty range, or too few samples.

    References
    ----------
    Ljung, System Identification, 2nd ed., sections 16.4 and 17.3; Björklund and Ljung, IEEE CDC 2003.
    """
    experiments = together(data)
    if experiments[0].output.shape[1] != 1:
        raise InputError(f"{experiments[0].name}: choose one output, as data.outputs([0]), to estimate its delays")
    if not 0 <= shortest <= longest or nb < 1 or na < 0:
        raise InputError(
            f"delays {shortest} to {longest} with na = {na}, nb = {nb}; give 0 <= shortest <= longest, na >= 0, nb >= 1"
        )
    m = experiments[0].input.shape[1]
    count = longest - shortest + nb
    orders = Orders(na, (count,) * m, 0, 0, (0,) * m, (shortest,) * m)
    check_inputs(experiments, orders)
    signals = channels(experiments, 0)
    first = first_row(orders, "estimate")
    rows = sum(max(len(c.output) - first, 0) for c in signals)
    if rows <= orders.size:
        raise InputError(
            f"{experiments[0].name}: {rows} usable samples for {orders.size} coefficients; record longer, or lower"
            " longest, na or nb"
        )
    whole = triangle(regression_blocks(signals, orders, first))
    candidates = np.arange(shortest, longest + 1)
    criteria = np.array([_criteria(whole, orders, i, len(candidates), rows) for i in range(m)])
    best = tuple(int(candidates[np.argmin(row)]) for row in criteria)
    return DelayEstimate(
        experiments[0].output_names[0], experiments[0].input_names, experiments[0].sample_time, best, candidates,
        criteria - criteria.min(axis=1, keepdims=True),
    )  # fmt: skip


def _criteria(factor: Array, orders: Orders, index: int, candidates: int, rows: int) -> Array:
    """BIC of the models that leave out 0, 1, ... of the first lags of one input."""
    own = [*range(orders.b(index).start, orders.b(index).stop)]
    others = [column for column in range(orders.size) if column not in own]
    # The first lag comes last: what it alone explains is then the last entry before the rest.
    ordered = triangle([factor[:, [*others, *own[::-1], orders.size]]])
    shares = ordered[: orders.size, -1] ** 2
    left = ordered[orders.size, -1] ** 2
    squares = left + np.concatenate([[0.0], np.cumsum(shares[::-1][: candidates - 1])])
    sizes = orders.size - np.arange(candidates)
    price = np.log(rows) + 2.0 * np.log(candidates)
    return np.asarray(rows * np.log(np.maximum(squares / rows, np.finfo(float).tiny)) + sizes * price)
