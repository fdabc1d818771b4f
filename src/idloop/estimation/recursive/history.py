"""What the coefficients of a recursive estimator did over a record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.polynomial.polynomials import Polynomials
from idloop.estimation.recursive.estimator import RecursivePolynomial

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class CoefficientHistory:
    """Coefficients over time, with the innovations that moved them."""

    output_name: str
    output_unit: str
    names: tuple[str, ...]  # of the k coefficients
    time: Array  # shape (r,): instants of the rows; later experiments follow the first without a gap [s]
    # shape (r, k): coefficients and standard errors after the sample at `time`
    values: Array
    stderr: Array
    innovations: Array  # shape (n,): of every sample [output unit]
    measured: Array  # shape (n,): what they are the prediction errors of [output unit]
    final: Polynomials  # the model at the end

    @property
    def fit(self) -> float:
        """FIT one step ahead, each sample predicted with the coefficients as they were before it [%]."""
        swing = float(np.linalg.norm(self.measured - np.nanmean(self.measured)))
        return 100.0 * (1.0 - float(np.linalg.norm(self.innovations)) / swing) if swing > 0.0 else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "output": self.output_name,
            **{name: getattr(self, name) for name in ("names", "time", "values", "stderr")},
            "innovation_rms": float(np.sqrt(np.nanmean(self.innovations**2))) if len(self.innovations) else None,
            "fit_on_the_way": self.fit,
            "final": self.final.to_dict(),
        }

    def draw(self, axes: Axes, which: Sequence[int]) -> None:
        """Draw some of the coefficients, by their places in `names`, with bands of two standard errors."""
        from idloop import drawing

        for number, index in enumerate(which):
            look = drawing.model_look(number)
            drawing.line(axes, self.time, self.values[:, index], label=self.names[index], **look)
            low, high = (self.values[:, index] + sign * 2.0 * self.stderr[:, index] for sign in (-1, 1))
            axes.fill_between(self.time, low, high, color=look["color"], alpha=0.15, linewidth=0)
        values = self.values[:, list(which)]
        if values.size:
            # The first bands are as wide as the prior: what comes after the first twentieth sets the scale.
            later = values[len(values) // 20 :]
            reach = 0.4 * max(float(np.ptp(later)), 1e-12)
            axes.set_ylim(float(np.min(later)) - reach, float(np.max(later)) + reach)


def track(
    estimator: RecursivePolynomial, data: SampledData | Sequence[SampledData], *, every: int = 1
) -> CoefficientHistory:
    """Run a record through a recursive estimator, which continues from its present state.

    Parameters
    ----------
    estimator : RecursivePolynomial
        Changed by this.
    data : SampledData or sequence of SampledData
        With one output; the signals before each experiment count as 0.
    every : int
        Samples from one remembered row to the next, for long records.

    Raises
    ------
    InputError
        More than one output, or other inputs than the estimator's.
    """
    experiments = together(data)
    first = experiments[0]
    if first.output.shape[1] != 1 or first.input.shape[1] != estimator.orders.inputs:
        raise InputError(
            f"{first.name}: {first.output.shape[1]} outputs and {first.input.shape[1]} inputs; the estimator is for"
            f" one output, as data.outputs([0]), and {estimator.orders.inputs} inputs"
        )
    innovations, times, values, errors = [], [], [], []
    begin = first.start
    for one in experiments:
        if len(experiments) > 1:
            estimator.forget_signals()
        left, value, error = estimator.follow(one.input, one.output[:, 0], every)
        innovations.append(left)
        values.append(value)
        errors.append(error)
        times.append(begin + one.sample_time * (np.arange(1, len(value) + 1) * every - 1))
        begin += one.sample_time * len(one)
    return CoefficientHistory(
        first.output_names[0], first.output_units[0], estimator.names, np.concatenate(times), np.vstack(values),
        np.vstack(errors), np.concatenate(innovations), np.concatenate([one.output[:, 0] for one in experiments]),
        estimator.polynomials,
    )  # fmt: skip
