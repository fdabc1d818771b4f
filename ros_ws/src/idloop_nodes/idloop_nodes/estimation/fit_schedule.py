"""Which window is fitted when, and what is published of a fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import FitSummary, Level, Status, encode_diagnostics, fit_to_statuses
from idloop_nodes.estimation.estimator_context import SHORTEST, EstimatorContext, Publish
from idloop_nodes.estimation.fit_jobs import FitAnswer, FitJob

if TYPE_CHECKING:
    from idloop.physics import Model


class FitSchedule:
    """Orders a fit of a sliding window every `fit_period`, judged on the samples after the window.

    `publish`: of ``estimator/fit``.
    """

    def __init__(self, context: EstimatorContext, publish: Publish) -> None:
        self._context = context
        self._publish = publish
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
        number, criterion = context.next_number(), context.parameters["criterion"]
        context.jobs.submit(FitJob(number, model, criterion, train, validation, (start, cut), (cut, end)))
        return f"fit {number} of {(cut - start) / SECOND:.1f} s, judged on {(end - cut) / SECOND:.1f} s"

    def take(self, answer: FitAnswer) -> int:
        """Publish a fit; return the stamp of the last sample that it was judged on [ns]."""
        stamp = answer.summary.validation_window[1] - self._context.period_ns
        self._newest = answer.summary
        statuses = fit_to_statuses(self._context.name, answer.summary)
        self._publish(encode_diagnostics(stamp, statuses))
        if answer.parameters:
            estimates = ", ".join(f"{one.name} = {one.line}" for one in answer.parameters)
            self._context.info(f"{statuses[0].message}: {estimates}")
        else:
            self._context.warn(f"no fit: {answer.summary.error}")
        return stamp

    def health(self, *, skipped: int, failures: int) -> Status:
        """Return the newest fit, and how the worker does."""
        values = {
            "submitted": str(self._context.submitted),
            "skipped": str(skipped),
            "worker_failures": str(failures),
        }
        fit = self._newest
        text = "no fit yet" if fit is None else fit_to_statuses("", fit)[0].message
        level = Level.WARN if failures or (fit is not None and fit.error) else Level.OK
        return Status("fits", text, level, values)
