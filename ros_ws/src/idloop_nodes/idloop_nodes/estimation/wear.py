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
from idloop_nodes.codec import Level, Status
from idloop_nodes.estimation.estimator_context import EstimatorContext

if TYPE_CHECKING:
    from idloop.monitoring import Baseline, Monitor, WatchState
    from idloop.monitoring.baseline import ReferenceStatistics
    from idloop.physics import Model
    from idloop.records import Record

USUAL = "usual"  # watch dry friction and what sits in couplings
LEARNING, ALARM, QUIET, CANNOT_TELL = "learning", "alarm", "quiet", "cannot_tell"


class Watched(NamedTuple):
    """The monitor after a job; the estimator keeps it for the next one."""

    state: bytes  # pickle of the monitor; empty when it could not be built
    settling: float  # settling time of the observer before a stretch [s]
    statuses: tuple[Status, ...]  # new contents of ``estimator/wear``: the monitor, then each watched parameter


def learn_normal(
    report: Report,
    *,
    node: str,
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
    return _watched(node, Monitor(baseline))


def check_stretch(report: Report, *, node: str, state: bytes, record: Record, new_run: bool) -> Watched:
    """Check a stretch that begins early by the settling time of the observer, in the worker."""
    monitor: Monitor = pickle.loads(state)  # noqa: S301  (our own estimator's)
    if new_run:
        monitor.begin()
    monitor.follow(record)
    return _watched(node, monitor)


def _watched(node: str, monitor: Monitor) -> Watched:
    baseline = monitor.baseline
    return Watched(pickle.dumps(monitor), baseline.settling + baseline.block, wear_statuses(node, monitor))


def wear_statuses(node: str, monitor: Monitor) -> tuple[Status, ...]:
    """Return the contents of ``estimator/wear``; the worst of the watches is that of the monitor."""
    baseline = monitor.baseline
    watches = [_watch(node, baseline, *both) for both in zip(baseline.normal, monitor.states(), strict=True)]
    alarms, unsure = (
        ", ".join(one.hardware_id for one in watches if one.values["state"] == state) for state in (ALARM, CANNOT_TELL)
    )
    state, line = QUIET, f"no wear; one false alarm in {baseline.false_alarm_hours:.4g} h"
    if alarms:
        state, line = ALARM, f"wear: {alarms}"
    elif unsure:
        state, line = CANNOT_TELL, f"no alarm; this data cannot tell about {unsure}"
    head = _head(node, baseline.model.name, state, line, baseline.false_alarm_hours, baseline.duration)
    return (replace(head, level=max(one.level for one in watches)), *watches)


def _head(node: str, model: str, state: str, line: str, hours: float, reference: float) -> Status:
    """The monitor: running time between two false alarms [h], and length of the healthy reference [s]."""
    values = {"model": model, "state": state, "false_alarm_hours": str(hours), "reference": str(reference), "error": ""}
    return Status(f"{node}: wear", line, values=values, hardware_id=model)


def _watch(node: str, baseline: Baseline, normal: ReferenceStatistics, state: WatchState) -> Status:
    """One watched parameter: an alarm is an error, a watch that can never alarm a warning."""
    growth, alarms, level = state.growth, state.alarms, Level.WARN if normal.why else Level.OK
    grown = ""
    if growth is not None:
        grown = f"{growth.value:+.3g} {state.unit} ({growth.low:.3g} .. {growth.high:.3g})"
    if state.state == ALARM:
        line, level = f"changed by {grown} against {state.value:.4g} {state.unit}" if grown else "changed", Level.ERROR
    elif state.state == QUIET:
        line = f"no growth of {state.watched:.3g} {state.unit}; {grown}"
    else:
        line = f"this data cannot tell: {state.why}"
    values = {
        "parameter": state.parameter,
        "unit": state.unit,
        "value": state.value,
        "watched": state.watched,
        "state": state.state,
        "able": "false" if normal.why else "true",
        "why": state.why,
        "growth": "" if growth is None else growth.value,
        "low": "" if growth is None else growth.low,
        "high": "" if growth is None else growth.high,
        "evidence": state.sum,
        "threshold": state.threshold,
        "blocks": state.blocks,
        "telling": state.telling,
        "delay": state.delay,
        "alarms": len(alarms),
        # Stamps of the first and the newest alarm, and of the likeliest onset before the newest [ns]
        "first": baseline.end_of(alarms[0].block) if alarms else 0,
        "newest": baseline.end_of(alarms[-1].block) if alarms else 0,
        "onset": baseline.end_of(alarms[-1].onset - 1) if alarms else 0,
    }
    texts = {key: str(value) for key, value in values.items()}
    return Status(f"{node}: {state.parameter}", line, level, texts, state.parameter)


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
        self._model, self._monitor = model, self._unlearnt(model)
        self._learnt = self._failed = False  # learnt: ordered, if not yet answered
        self.restart()

    def _unlearnt(self, model: Model) -> Watched:
        line = "learning what is normal"
        return Watched(b"", 0.0, (_head(self._context.name, model.name, LEARNING, line, 0.0, 0.0),))

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
            node=self._context.name,
            model=model,
            watches=tuple(values["monitor"]),
            vary=tuple(values["monitor_vary"]),
            false_alarms=values["monitor_false_alarms"],
            records=() if bags else (self._context.buffer.record(model, first, stop),),
            bags=bags,
        )
        self._order(work, stop, self._unlearnt(model))
        self._learnt, self._from = True, stop

    def _cut(self, first: int, stop: int) -> None:
        start = max(first - self._overlap, self._context.buffer.first or 0)
        self._waiting.append((stop, self._context.buffer.record(self._model, start, stop)))
        self._from = stop

    def _next(self) -> None:
        """One job at a time: each needs the monitor that the one before returned."""
        if self._ordered is None and self._waiting and self._monitor.state:
            stop, record = self._waiting.popleft()
            node, state = self._context.name, self._monitor.state
            work = partial(check_stretch, node=node, state=state, record=record, new_run=self._new_run)
            self._new_run = False
            self._order(work, stop, self._monitor)

    def _order(self, work: partial[Watched], stamp: int, before: Watched) -> None:
        """Give the worker a job about data up to a stamp [ns]; `before`: what stays of the monitor when it fails."""
        order = self._ordered = object()

        def done(result: Watched) -> None:
            if order is self._ordered:
                self._take(stamp, result)

        def failed(reason: str) -> None:
            head, *watches = before.statuses
            values = head.values | {"error": reason}
            head = replace(head, message=reason, level=max(head.level, Level.WARN), values=values)
            done(before._replace(statuses=(head, *watches)))

        self._context.jobs.submit(work, done, failed)

    def _take(self, stamp: int, monitor: Watched) -> None:
        """Publish what the worker found, and order what waits."""
        self._ordered = None
        before, self._monitor = self._monitor.statuses, monitor
        self._failed = not monitor.state
        self._context.publish("wear", stamp, list(monitor.statuses))
        self._log(before, *monitor.statuses)
        self._next()

    def _log(self, before: tuple[Status, ...], head: Status, *watches: Status) -> None:
        error = head.values["error"]
        if error:
            if error != before[0].values["error"]:
                self._context.warn(f"wear: {error}")
            return
        alarmed = {one.hardware_id for one in before[1:] if one.values["alarms"] != "0"}
        for one in watches:
            if one.values["alarms"] != "0" and one.hardware_id not in alarmed:
                self._context.warn(f"wear of {one.hardware_id}: {one.message}")
        if not before[1:]:
            reference = float(head.values["reference"])
            self._context.info(f"wear: {reference:.4g} s of healthy data as the reference; {head.message}")

    def health(self) -> list[Status]:
        """Return what is watched; nothing when nothing is."""
        if not self._context.parameters["monitor"]:
            return []
        head, *watches = self._monitor.statuses
        values = {one.hardware_id: one.message for one in watches}
        return [Status("wear", head.message, head.level, values | {"waiting": str(len(self._waiting))})]
