"""When stretches of data are searched for wear, and what is published of it."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import Level, Status, WearSummary, encode_diagnostics, wear_to_statuses
from idloop_nodes.estimation.estimator_context import EstimatorContext, Publish
from idloop_nodes.estimation.monitor_jobs import CheckJob, LearnJob, MonitorAnswer

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record


class MonitorSchedule:
    """Learns from the healthy start of a run, or from bags, and then checks every stretch of data once.

    `model`: of the healthy machine; later fits and steps of the ladder do not change it. `publish`: of
    ``estimator/wear``.
    """

    def __init__(self, context: EstimatorContext, model: Model, publish: Publish) -> None:
        self._context = context
        self._model = model
        self._publish = publish
        self._state = b""
        self._settling = 0.0
        self._summary = WearSummary(model.name)
        self._waiting: deque[tuple[int, Record]] = deque()
        self._ordered: int | None = None
        self._learnt = False  # ordered, if not yet answered
        self._from: int | None = None  # stamp from which on nothing was checked [ns]
        self._new_run = False
        self._failed = False

    @property
    def wanted(self) -> bool:
        """Whether anything is watched."""
        return bool(self._context.parameters["monitor"]) and not self._failed

    @property
    def busy(self) -> bool:
        """Whether the worker has an order, or will have one as soon as it is free."""
        return self._ordered is not None or bool(self._waiting)

    @property
    def oldest(self) -> int | None:
        """Stamp from which on samples are still needed [ns]; None where there is nothing to watch."""
        if not self.wanted or self._from is None:
            return None
        if not self._state:
            return self._context.buffer.first
        return self._from - self._overlap

    @property
    def _overlap(self) -> int:
        return int(self._settling * SECOND) + self._context.period_ns

    def begin(self, model: Model) -> None:
        """Learn again: the model of another machine."""
        self._model, self._state, self._summary = model, b"", WearSummary(model.name)
        self._learnt = self._failed = False
        self.restart()

    def restart(self) -> None:
        """A new run of the clock: what was learnt stays."""
        self._waiting.clear()
        self._from, self._new_run = None, True
        # The result of a job under way about the old run counts; learning begins again.
        if not self._state:
            self._learnt, self._ordered = False, None

    def follow(self, last: int) -> None:
        """Order what is due after the sample `last` [ns]."""
        if not self.wanted or self._context.buffer.first is None:
            return
        if self._from is None:
            self._from = self._context.buffer.first
        end = last + self._context.period_ns + self._context.period_ns // 2
        if not self._learnt:
            self._learn(end)
        if self._state:
            period = self._context.nanoseconds("monitor_period")
            while end >= self._from + period:
                self._cut(self._from + period)
        self._next()

    def finish(self, last: int) -> None:
        """Check what is left at the end of a run."""
        end = last + self._context.period_ns
        if self.wanted and self._state and self._from is not None and end > self._from:
            self._cut(end)
            self._next()

    def _learn(self, end: int) -> None:
        values = self._context.parameters
        bags, first = tuple(values["monitor_reference"]), self._from or 0
        stop = first if bags else first + self._context.nanoseconds("monitor_learn")
        if end < stop:
            return
        record = () if bags else (self._context.buffer.record(self._model, first, stop),)
        watches, vary = tuple(values["monitor"]), tuple(values["monitor_vary"])
        number, false_alarms = self._context.next_number(), values["monitor_false_alarms"]
        self._order(LearnJob(number, stop, self._model, watches, vary, false_alarms, record, bags))
        self._learnt, self._from = True, stop

    def _cut(self, stop: int) -> None:
        assert self._from is not None  # noqa: S101 - the callers have checked
        start = max(self._from - self._overlap, self._context.buffer.first or 0)
        self._waiting.append((stop, self._context.buffer.record(self._model, start, stop)))
        self._from = stop

    def _next(self) -> None:
        """One job at a time: each needs the monitor that the one before returned."""
        if self._ordered is None and self._waiting and self._state:
            stop, record = self._waiting.popleft()
            number = self._context.next_number()
            job = CheckJob(number, stop, self._state, record, self._new_run, self._summary, self._settling)
            self._new_run = False
            self._order(job)

    def _order(self, job: LearnJob | CheckJob) -> None:
        self._ordered = job.number
        self._context.jobs.submit(job)

    def take(self, answer: MonitorAnswer) -> None:
        """Publish what the worker found, and order what waits."""
        if answer.number != self._ordered:
            return
        self._ordered = None
        before, self._summary = self._summary, answer.summary
        self._state, self._settling = answer.state, answer.settling
        self._failed = not answer.state
        self._publish(encode_diagnostics(answer.stamp, wear_to_statuses(self._context.name, answer.summary)))
        self._log(before)
        self._next()

    def _log(self, before: WearSummary) -> None:
        summary = self._summary
        if summary.error:
            if summary.error != before.error:
                self._context.warn(f"wear: {summary.error}")
            return
        raised = {watch.parameter: watch.alarms for watch in before.watches}
        for watch in summary.watches:
            if watch.alarms > 0 and raised.get(watch.parameter, 0) == 0:
                self._context.warn(f"wear of {watch.parameter}: {watch.line}")
        if not before.watches:
            self._context.info(f"wear: {summary.reference:.4g} s of healthy data as the reference; {summary.line}")

    def health(self) -> list[Status]:
        """Return what is watched; nothing when nothing is."""
        if not self._context.parameters["monitor"]:
            return []
        summary = self._summary
        values = {watch.parameter: watch.line for watch in summary.watches}
        values |= {"waiting": str(len(self._waiting))}
        return [Status("wear", summary.line, Level(summary.level), values)]
