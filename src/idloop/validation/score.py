"""Measures of a black-box model on sampled data: free run, prediction some steps ahead, residual tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.feedback import detect_feedback
from idloop.estimation.linear import LinearModel
from idloop.estimation.networks import NarxModel
from idloop.validation.residual import ResidualTest, residual_tests

_LAGS = 25  # of the residual tests; four times as many samples are needed
_OVERFLOW = 1e100
_STRETCHES = 20  # of a record, for the standard error of a difference


@dataclass(frozen=True, eq=False)
class Score:
    """Measures of one model, all on the same data."""

    steps: int  # prediction horizon of the second measure [samples]
    output_names: tuple[str, ...]
    # shape (p,): FIT [%] of the free run and of the prediction, over all stretches together; minus infinity where the
    # model diverges
    free_run: Array
    ahead: Array
    simulated: tuple[Array, ...]  # shape (n, p): free run of each stretch [output units]
    # Of the one-step errors on the longest stretch; empty where that is too short or they overflow
    tests: tuple[ResidualTest, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "free_run": self._fit(self.free_run),
            "ahead": {"steps": self.steps, **self._fit(self.ahead)},
            "residual": [test.to_dict() for test in self.tests],
        }

    def _fit(self, values: Array) -> dict[str, Any]:
        by_output = dict(zip(self.output_names, map(float, values), strict=True))
        return {"fit": by_output, "mean_fit": float(np.mean(values))}


def score(model: LinearModel | NarxModel, data: Sequence[SampledData], steps: int = 10) -> Score:
    """Compute the measures of a model on data.

    `steps`: prediction horizon [samples]. Raises InputError: no data, or data of other signals or another sample time
    than the model's.
    """
    if not data:
        raise InputError("no data to judge the model on; give at least one record")
    # A network takes its first outputs from the measurement.
    first = int(getattr(model, "first", 0))
    with np.errstate(all="ignore"):
        simulated = tuple(model.simulate(one) for one in data)
        ahead = [model.predict(one, steps) for one in data]
    longest = max(data, key=len)
    tests: list[ResidualTest] = []
    if len(longest) - first >= 4 * _LAGS:
        with np.errstate(all="ignore"):
            errors = model.innovations(longest)[first:]
        # Residuals of a diverged prediction are not tested.
        if np.all(np.abs(errors) < _OVERFLOW):
            fed_back = detect_feedback(longest).possible
            follows = (longest.reference, longest.feedforward) if fed_back else ()
            outside = [one[first:] for one in follows if one is not None and np.ptp(one) > 0.0]
            tests = residual_tests(
                errors, longest.input[first:, 0], longest.output_names, _LAGS, outside=outside, fed_back=fed_back
            )
    return Score(
        steps, data[0].output_names, pooled_fit(data, simulated, first), pooled_fit(data, ahead, first), simulated,
        tuple(tests),
    )  # fmt: skip


def fit_difference(data: Sequence[SampledData], one: Score, other: Score) -> tuple[float, float]:
    """Difference in FIT of the free runs of two models on the same data, with its standard error.

    The standard error is that of the paired difference, over stretches of the record that are long beside the
    correlation time of the errors (Diebold and Mariano, J. Business and Economic Statistics 13,
    1995).

    `one`, `other`: of two models on these data. Returns `difference`: mean FIT of `one` less that of `other` [%].
    `stderr`: [%]; infinite where the data are too short.
    """
    difference = float(np.mean(one.free_run) - np.mean(other.free_run))
    if not np.isfinite(difference):
        return difference, 0.0
    squares = [
        [(each.output - run) ** 2 for each, run in zip(data, score.simulated, strict=True)] for score in (one, other)
    ]
    totals = [np.sum([np.sum(part, axis=0) for part in parts], axis=0) for parts in squares]
    deviations = np.sum([np.sum((each.output - np.mean(each.output, axis=0)) ** 2, axis=0) for each in data], axis=0)
    # Derivative of the FIT by the sum of squares, at the mean of both.
    slope = 50.0 / np.sqrt(np.maximum(0.5 * (totals[0] + totals[1]) * deviations, 1e-300))
    gains = np.concatenate([(b - a) @ slope / len(slope) for a, b in zip(*squares, strict=True)])
    if len(gains) < 2 * _STRETCHES:
        return difference, float("inf")
    sums = np.array([np.sum(part) for part in np.array_split(gains, _STRETCHES)])
    return difference, float(np.std(sums, ddof=1) * np.sqrt(_STRETCHES))


def pooled_fit(data: Sequence[SampledData], modelled: Sequence[Array], first: int = 0) -> Array:
    """FIT of every output over all stretches, each about its own mean.

    `modelled` (n, p); `first`: samples at the start of each stretch to leave out. Returns shape (p,): ``100 (1 -
    sqrt(sum of squared errors / sum of squared deviations))`` [%]; minus infinity where the model is not finite or a
    constant output is missed.
    """
    errors, deviations = 0.0, 0.0
    with np.errstate(all="ignore"):
        for one, values in zip(data, modelled, strict=True):
            measured = one.output[first:]
            errors = errors + np.sum((measured - values[first:]) ** 2, axis=0)
            deviations = deviations + np.sum((measured - np.mean(measured, axis=0)) ** 2, axis=0)
        fit = 100.0 * (1.0 - np.sqrt(errors / deviations))
    return np.asarray(np.where(np.isfinite(fit), fit, np.where(errors == 0.0, 100.0, -np.inf)), dtype=float)
