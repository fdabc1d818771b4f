"""Fits of a sliding window, judged on the samples after it: what the worker does, when, and what is published."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.records.bags.cdr import SECOND
from idloop.worker_process import Report
from idloop_nodes.codec import FitSummary, Level, ParameterSummary, Status, fit_to_statuses
from idloop_nodes.estimation.estimator_context import SHORTEST, EstimatorContext

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.validation import Comparison

LAGS = 25  # of the whiteness test

Fitted = tuple[FitSummary, tuple[ParameterSummary, ...]]


def fit_window(report: Report, *, model: Model, train: Record, validation: Record, summary: FitSummary) -> Fitted:
    """Fit a model to one record and judge it on another; `summary` says which, and holds the criterion."""
    from idloop.estimation import fit
    from idloop.validation import compare

    result = fit(model, [train], criterion=summary.criterion, progress=report)
    unseen, seen = (compare(result.model, record) for record in (validation, train))
    estimates = tuple(
        ParameterSummary(one.name, one.value, one.stderr, one.unit, one.min, one.max, one.free)
        for one in result.model.parameters
        if one.free
    )
    judged = replace(
        summary,
        criterion=result.criterion,
        fit=dict(unseen.fit),
        fit_train=dict(seen.fit),
        loss=result.loss,
        whiteness=whiteness(unseen),
        missed=missed(unseen),
    )
    return judged, estimates


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


class FitSchedule:
    """Orders a fit of a sliding window every `fit_period`; `judged` takes each that succeeded, and its last stamp."""

    def __init__(
        self, context: EstimatorContext, judged: Callable[[FitSummary, Sequence[ParameterSummary], int], None]
    ) -> None:
        self._context = context
        self._judged = judged
        self._next: int | None = None
        self._newest: FitSummary | None = None

    def restart(self) -> None:
        """Begin again with the next sample."""
        self._next = None

    @property
    def due(self) -> int | None:
        """Stamp after the last sample of the next window and its validation; None when no fit is planned."""
        return self._next if self._context.parameters["fit_period"] else None

    @property
    def spans(self) -> tuple[int, int]:
        """Length of a window and of its validation [ns]."""
        return self._context.nanoseconds("window"), self._context.nanoseconds("validation")

    def follow(self, model: Model, last: int) -> None:
        """Order what is due after the sample `last` [ns]."""
        window, validation = self.spans
        first, step = self._context.buffer.first, self._context.period_ns
        period = self._context.nanoseconds("fit_period")
        if not period or first is None:
            return
        if self._next is None:
            self._next = first + window + validation
        # A window ends with the sample before its end stamp; half a period keeps rounding out.
        while last + step // 2 >= self._next - step:
            self._submit(model, self._next - validation - window, self._next - validation, self._next)
            self._next += period

    def fit_now(self, model: Model, last: int | None) -> str:
        """Fit what there is, a part of it kept for validation; return what was started, or raise InputError."""
        first = self._context.buffer.first
        if first is None or last is None:
            raise InputError("no samples yet")
        window, validation = self.spans
        end = last + self._context.period_ns
        have = min(end - first, window + validation)
        started = self._submit(model, end - have, end - have * validation // (window + validation), end)
        if not started:
            raise InputError("too few samples")
        return started

    def _submit(self, model: Model, start: int, cut: int, end: int) -> str:
        """Return what was started; empty for too few samples."""
        context = self._context
        train, validation = context.buffer.split(model, start, cut, end)
        if min(train.time.size, validation.time.size) < SHORTEST:
            return ""
        criterion = context.parameters["criterion"]
        summary = FitSummary(model.name, tuple(model.effect_names), criterion, (start, cut), (cut, end))
        context.jobs.submit(
            partial(fit_window, model=model, train=train, validation=validation, summary=summary),
            self._done,
            lambda reason: self._done((replace(summary, error=reason), ())),
            replaceable=True,
        )
        number, fitted, unseen = context.jobs.submitted, (cut - start) / SECOND, (end - cut) / SECOND
        return f"fit {number} of {fitted:.1f} s, judged on {unseen:.1f} s"

    def _done(self, fitted: Fitted) -> None:
        """Publish a fit."""
        summary, estimates = fitted
        self._newest = summary
        stamp = summary.validation_window[1] - self._context.period_ns
        statuses = fit_to_statuses(self._context.name, summary)
        self._context.publish("fit", stamp, statuses)
        if estimates:
            listed = ", ".join(f"{one.name} = {one.line}" for one in estimates)
            self._context.info(f"{statuses[0].message}: {listed}")
            self._judged(summary, estimates, stamp)
        else:
            self._context.warn(f"no fit: {summary.error}")

    def health(self) -> Status:
        """Return the newest fit, and how the worker does."""
        jobs, fit = self._context.jobs, self._newest
        values = {"submitted": str(jobs.submitted), "skipped": str(jobs.skipped), "worker_failures": str(jobs.failures)}
        text = "no fit yet" if fit is None else fit_to_statuses("", fit)[0].message
        level = Level.WARN if jobs.failures or (fit is not None and fit.error) else Level.OK
        return Status("fits", text, level, values)
