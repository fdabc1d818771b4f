"""Wear: what is normal is learnt once, then each stretch of data is checked; when, and what is published of it."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from idloop.records.bags.cdr import SECOND
from idloop.worker_process import Report
from idloop_nodes.codec import Level, Status, WatchSummary, WearSummary, wear_to_statuses
from idloop_nodes.estimation.estimator_context import EstimatorContext

if TYPE_CHECKING:
    from idloop.monitoring import Baseline, Monitor, WatchState
    from idloop.physics import Model
    from idloop.records import Record

USUAL = "usual"  # watch dry friction and what sits in couplings


class Watched(NamedTuple):
    """The monitor after a job; the estimator keeps it for the next one."""

    state: bytes  # pickle of the monitor; empty when it could not be built
    settling: float  # settling time of the observer before a stretch [s]
    summary: WearSummary  # new contents of ``estimator/wear``


def learn_normal(
    report: Report,
    *,
    model: Model,
    watches: tuple[str, ...],
    vary: tuple[str, ...],
    false_alarms: str,
    records: Sequence[Record],
    bags: Sequence[str],
) -> Watched:
    """Learn what is normal from the healthy start of this run, or else from bags, in the worker."""
    from idloop.monitoring import Monitor, choose_watches, learn, parse_false_alarms
    from idloop.records import read_records

    baseline = learn(
        model,
        records or tuple(read_records([Path(bag) for bag in bags], model)),
        choose_watches(model, [] if watches == (USUAL,) else watches),
        varying=vary,
        false_alarm_hours=parse_false_alarms(false_alarms),
        progress=report,
    )
    return _watched(Monitor(baseline))


def check_stretch(report: Report, *, state: bytes, record: Record, new_run: bool) -> Watched:
    """Check a stretch that begins early by the settling time of the observer, in the worker."""
    monitor: Monitor = pickle.loads(state)  # noqa: S301  (our own estimator's)
    if new_run:
        monitor.begin()
    monitor.follow(record)
    return _watched(monitor)


def _watched(monitor: Monitor) -> Watched:
    baseline = monitor.baseline
    return Watched(pickle.dumps(monitor), baseline.settling + baseline.block, summarise_wear(monitor))


def summarise_wear(monitor: Monitor) -> WearSummary:
    """Return the contents of ``estimator/wear``."""
    baseline = monitor.baseline
    able = [not normal.why for normal in baseline.normal]
    watches = tuple(_summarise(baseline, state, able=can) for state, can in zip(monitor.states(), able, strict=True))
    worst = next((s for s in ("alarm", "cannot_tell") if any(w.state == s for w in watches)), "quiet")
    return WearSummary(baseline.model.name, worst, baseline.false_alarm_hours, baseline.duration, watches)


def _summarise(baseline: Baseline, state: WatchState, *, able: bool) -> WatchSummary:
    growth, alarms = state.growth, state.alarms
    same = ("parameter", "unit", "value", "watched", "state", "why", "threshold", "blocks", "telling", "delay")
    return WatchSummary(
        **{name: getattr(state, name) for name in same},
        able=able,
        growth=None if growth is None else growth.value,
        low=None if growth is None else growth.low,
        high=None if growth is None else growth.high,
        evidence=state.sum,
        alarms=len(alarms),
        first=baseline.end_of(alarms[0].block) if alarms else 0,
        newest=baseline.end_of(alarms[-1].block) if alarms else 0,
        onset=baseline.end_of(alarms[-1].onset - 1) if alarms else 0,
    )


class WearSchedule:
    """Learns from the healthy start of a run, or from bags, and then checks every stretch of data once."""

    def __init__(self, context: EstimatorContext, model: Model) -> None:
        self._context = context
        self._waiting: deque[tuple[int, Record]] = deque()
        self._ordered: object = None  # stands for the job under way
        self._from: int | None = None  # stamp from which on nothing was checked [ns]
        self.begin(model)
        self._new_run = False

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
        return self._from - self._overlap if self._monitor.state else self._context.buffer.first

    @property
    def _overlap(self) -> int:
        return int(self._monitor.settling * SECOND) + self._context.period_ns

    def begin(self, model: Model) -> None:
        """Learn again: the model of another machine."""
        self._model, self._monitor = model, Watched(b"", 0.0, WearSummary(model.name))
        self._learnt = self._failed = False  # learnt: ordered, if not yet answered
        self.restart()

    def restart(self) -> None:
        """A new run of the clock: what was learnt stays."""
        self._waiting.clear()
        self._from, self._new_run = None, True
        # The result of a job under way about the old run counts; learning begins again.
        if not self._monitor.state:
            self._learnt, self._ordered = False, None

    def follow(self, last: int) -> None:
        """Order what is due after the sample `last` [ns]."""
        if not self.wanted or self._context.buffer.first is None:
            return
        if self._from is None:
            self._from = self._context.buffer.first
        end = last + self._context.period_ns + self._context.period_ns // 2
        if not self._learnt:
            self._learn(self._from, end)
        if self._monitor.state:
            period = self._context.nanoseconds("monitor_period")
            while end >= self._from + period:
                self._cut(self._from, self._from + period)
        self._next()

    def finish(self, last: int) -> None:
        """Check what is left at the end of a run."""
        end = last + self._context.period_ns
        if self.wanted and self._monitor.state and self._from is not None and end > self._from:
            self._cut(self._from, end)
            self._next()

    def _learn(self, first: int, end: int) -> None:
        values, model = self._context.parameters, self._model
        bags = tuple(values["monitor_reference"])
        stop = first if bags else first + self._context.nanoseconds("monitor_learn")
        if end < stop:
            return
        work = partial(
            learn_normal,
            model=model,
            watches=tuple(values["monitor"]),
            vary=tuple(values["monitor_vary"]),
            false_alarms=values["monitor_false_alarms"],
            records=() if bags else (self._context.buffer.record(model, first, stop),),
            bags=bags,
        )
        self._order(work, stop, Watched(b"", 0.0, WearSummary(model.name)))
        self._learnt, self._from = True, stop

    def _cut(self, first: int, stop: int) -> None:
        start = max(first - self._overlap, self._context.buffer.first or 0)
        self._waiting.append((stop, self._context.buffer.record(self._model, start, stop)))
        self._from = stop

    def _next(self) -> None:
        """One job at a time: each needs the monitor that the one before returned."""
        if self._ordered is None and self._waiting and self._monitor.state:
            stop, record = self._waiting.popleft()
            work = partial(check_stretch, state=self._monitor.state, record=record, new_run=self._new_run)
            self._new_run = False
            self._order(work, stop, self._monitor)

    def _order(self, work: partial[Watched], stamp: int, before: Watched) -> None:
        """Give the worker a job about data up to a stamp [ns]; `before`: what stays of the monitor when it fails."""
        order = self._ordered = object()

        def done(result: Watched) -> None:
            if order is self._ordered:
                self._take(stamp, result)

        def failed(reason: str) -> None:
            done(before._replace(summary=replace(before.summary, error=reason)))

        self._context.jobs.submit(work, done, failed)

    def _take(self, stamp: int, monitor: Watched) -> None:
        """Publish what the worker found, and order what waits."""
        self._ordered = None
        before, self._monitor = self._monitor.summary, monitor
        self._failed = not monitor.state
        self._context.publish("wear", stamp, wear_to_statuses(self._context.name, monitor.summary))
        self._log(before, monitor.summary)
        self._next()

    def _log(self, before: WearSummary, summary: WearSummary) -> None:
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
        summary = self._monitor.summary
        values = {watch.parameter: watch.line for watch in summary.watches}
        return [Status("wear", summary.line, Level(summary.level), values | {"waiting": str(len(self._waiting))})]
