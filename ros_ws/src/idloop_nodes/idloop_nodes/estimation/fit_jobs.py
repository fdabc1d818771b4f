"""Fits of a window, judged on the samples after it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from idloop.worker_process import Report
from idloop_nodes.codec import FitSummary, ParameterSummary

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.validation import Comparison

LAGS = 25  # of the whiteness test


@dataclass(frozen=True)
class FitAnswer:
    """Result of a job; `parameters` is empty when the fit failed."""

    number: int
    summary: FitSummary
    parameters: tuple[ParameterSummary, ...]


@dataclass(frozen=True)
class FitJob:
    """Fit `model` to `fit_record`, judge it on `validation_record`."""

    number: int
    model: Model
    criterion: str
    fit_record: Record
    validation_record: Record
    fit_window: tuple[int, int]
    validation_window: tuple[int, int]
    replaceable: bool = True

    def work(self, report: Report) -> FitAnswer:
        """Fit and judge."""
        from idloop.estimation import fit
        from idloop.validation import compare

        result = fit(self.model, [self.fit_record], criterion=self.criterion, progress=report)
        unseen, seen = (compare(result.model, record) for record in (self.validation_record, self.fit_record))
        summary = FitSummary(
            self.model.name,
            tuple(self.model.effect_names),
            result.criterion,
            self.fit_window,
            self.validation_window,
            fit=dict(unseen.fit),
            fit_train=dict(seen.fit),
            loss=result.loss,
            whiteness=whiteness(unseen),
            missed=missed(unseen),
        )
        return FitAnswer(self.number, summary, summarise(result.model))

    def failed(self, reason: str) -> FitAnswer:
        """Return the answer of a fit that failed."""
        summary = FitSummary(
            self.model.name,
            tuple(self.model.effect_names),
            self.criterion,
            self.fit_window,
            self.validation_window,
            error=reason,
        )
        return FitAnswer(self.number, summary, ())


def whiteness(comparison: Comparison) -> dict[str, float]:
    """Return for each output the p-value of the whiteness test of the free-run residual.

    Not of the prediction error: its observer takes a missing effect for a disturbance and whitens it.
    """
    import numpy as np

    from idloop.validation.residual import ljung_box

    found = {}
    for name, residual in zip(comparison.names, (comparison.measured - comparison.simulated).T, strict=True):
        known = residual[np.isfinite(residual)]
        if len(known) > 4 * LAGS:
            found[name] = ljung_box(known, LAGS)[1]
    return found


def missed(comparison: Comparison) -> dict[str, float]:
    """Return for each output the rms error of the free run over the noise of its sensor, stated or else estimated."""
    from idloop.estimation.observer.sensor_noise import noise_std

    found = {}
    for output, measured in zip(comparison.model.outputs, comparison.measured.T, strict=True):
        noise, error = output.noise or noise_std(measured), comparison.rmse[output.name]
        if noise > 0.0 and math.isfinite(error):
            found[output.name] = float(error / noise)
    return found


def summarise(model: Model) -> tuple[ParameterSummary, ...]:
    """Return the model's estimated parameters."""
    return tuple(
        ParameterSummary(one.name, one.value, one.stderr, one.unit, one.min, one.max, one.free)
        for one in model.parameters
        if one.free
    )
