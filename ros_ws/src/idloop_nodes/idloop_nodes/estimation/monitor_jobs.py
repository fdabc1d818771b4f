"""The estimator's jobs about wear: learn what is normal, then check each stretch of data.

The monitor stays with the worker: the estimator keeps it as a pickle that it sends with the next job.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from idloop.worker_process import Report
from idloop_nodes.codec import WatchSummary, WearSummary

if TYPE_CHECKING:
    from idloop.monitoring import Baseline, Monitor, WatchState
    from idloop.physics import Model
    from idloop.records import Record

USUAL = "usual"  # watch dry friction and what sits in couplings


@dataclass(frozen=True)
class MonitorAnswer:
    """Result of a job."""

    number: int  # of the job
    stamp: int  # after the newest sample that was used [ns]
    state: bytes  # pickle of the monitor, for the next job; empty when it could not be built
    settling: float  # settling time of the observer before a stretch [s]
    summary: WearSummary  # new contents of ``estimator/wear``


@dataclass(frozen=True)
class LearnJob:
    """Learn what is normal."""

    number: int
    stamp: int
    model: Model
    # As the parameters `monitor` and `monitor_vary` have them
    watches: tuple[str, ...]
    vary: tuple[str, ...]
    false_alarms: str  # as ``per 1000 h``
    records: tuple[Record, ...] = ()  # the healthy start of this run; empty when there are bags
    bags: tuple[str, ...] = ()  # recordings of the healthy machine
    replaceable: bool = False

    def work(self, report: Report) -> MonitorAnswer:
        """Learn."""
        from idloop.monitoring import Monitor, choose_watches, learn, parse_false_alarms
        from idloop.records import read_records

        records = self.records or tuple(read_records([Path(bag) for bag in self.bags], self.model))
        baseline = learn(
            self.model,
            records,
            choose_watches(self.model, [] if self.watches == (USUAL,) else self.watches),
            varying=self.vary,
            false_alarm_hours=parse_false_alarms(self.false_alarms),
            progress=report,
        )
        return _answer(self.number, self.stamp, Monitor(baseline))

    def failed(self, reason: str) -> MonitorAnswer:
        """Return the answer when nothing could be learnt."""
        return MonitorAnswer(self.number, self.stamp, b"", 0.0, WearSummary(self.model.name, error=reason))


@dataclass(frozen=True)
class CheckJob:
    """Check a stretch of data."""

    number: int
    stamp: int
    state: bytes  # pickle of the monitor
    record: Record  # begins early by the settling time of the observer
    new_run: bool  # whether a new run of the clock begins with it
    known: WearSummary  # newest result before it
    settling: float
    replaceable: bool = False

    def work(self, report: Report) -> MonitorAnswer:
        """Check it."""
        monitor: Monitor = pickle.loads(self.state)  # noqa: S301  (our own estimator's)
        if self.new_run:
            monitor.begin()
        monitor.follow(self.record)
        return _answer(self.number, self.stamp, monitor)

    def failed(self, reason: str) -> MonitorAnswer:
        """Return the answer of a stretch that could not be checked; earlier results stay."""
        return MonitorAnswer(self.number, self.stamp, self.state, self.settling, replace(self.known, error=reason))


def _answer(number: int, stamp: int, monitor: Monitor) -> MonitorAnswer:
    baseline = monitor.baseline
    return MonitorAnswer(
        number, stamp, pickle.dumps(monitor), baseline.settling + baseline.block, summarise_wear(monitor)
    )


def summarise_wear(monitor: Monitor) -> WearSummary:
    """Return the contents of ``estimator/wear``."""
    baseline = monitor.baseline
    able = [not normal.why for normal in baseline.normal]
    watches = tuple(_summarise(baseline, state, able=can) for state, can in zip(monitor.states(), able, strict=True))
    worst = next((s for s in ("alarm", "cannot_tell") if any(w.state == s for w in watches)), "quiet")
    return WearSummary(baseline.model.name, worst, baseline.false_alarm_hours, baseline.duration, watches)


def _summarise(baseline: Baseline, state: WatchState, *, able: bool) -> WatchSummary:
    growth, alarms = state.growth, state.alarms
    return WatchSummary(
        parameter=state.parameter,
        unit=state.unit,
        value=state.value,
        watched=state.watched,
        state=state.state,
        able=able,
        why=state.why,
        growth=None if growth is None else growth.value,
        low=None if growth is None else growth.low,
        high=None if growth is None else growth.high,
        evidence=state.sum,
        threshold=state.threshold,
        blocks=state.blocks,
        telling=state.telling,
        delay=state.delay,
        alarms=len(alarms),
        first=baseline.end_of(alarms[0].block) if alarms else 0,
        newest=baseline.end_of(alarms[-1].block) if alarms else 0,
        onset=baseline.end_of(alarms[-1].onset - 1) if alarms else 0,
    )
