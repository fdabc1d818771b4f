"""The estimator's side of watching wear: which stretch of data goes to the worker when, and what comes of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

from idloop_nodes.codec import Level, Status, WearSummary, encode_diagnostics, wear_to_statuses
from idloop_nodes.estimation.monitor_jobs import LearnJob, LookJob, MonitorAnswer
from idloop_nodes.parameters import NodeParameters
from idloop_nodes.streams.sample_buffer import SECOND, DataBook

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record
    from idloop_nodes.estimation.worker import Worker


class Monitoring:
    """Learns from the healthy start of a run, or from bags, and then looks at every stretch of data once.

    Parameters
    ----------
    node : str
        Name of the node.
    say, warn : callable
        Take one line for the log.
    parameters : NodeParameters
        monitor, monitor_reference, monitor_learn, monitor_period, monitor_false_alarms, monitor_vary, sample_time.
    book : DataBook
    worker : Worker
    numbers : callable
        Returns the number of the next job.
    model : Model
        Of the healthy machine; fits and steps of the ladder that follow do not change it.
    publish : callable
    """

    def __init__(
        self,
        node: str,
        say: Callable[[str], object],
        warn: Callable[[str], object],
        parameters: NodeParameters,
        book: DataBook,
        worker: Worker,
        numbers: Callable[[], int],
        model: Model,
        publish: Callable[[bytes], None],
    ) -> None:
        self._node = node
        self._say, self._warn = say, warn
        self._parameters = parameters
        self._book = book
        self._worker = worker
        self._numbers = numbers
        self._model = model
        self._publish = publish
        self._period_ns: int = round(parameters["sample_time"] * SECOND)
        self._state = b""
        self._settling = 0.0
        self._summary = WearSummary(model.name)
        self._waiting: deque[tuple[int, Record]] = deque()
        self._ordered: int | None = None
        self._learnt = False  # ordered, if not yet answered
        self._from: int | None = None  # stamp from which on nothing was looked at [ns]
        self._anew = False
        self._failed = False

    @property
    def wanted(self) -> bool:
        """Whether anything is watched."""
        return bool(self._parameters["monitor"]) and not self._failed

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
            return self._book.first
        return self._from - self._overlap

    @property
    def _overlap(self) -> int:
        return int(self._settling * SECOND) + self._period_ns

    def begin(self, model: Model) -> None:
        """Learn anew: the model of another machine."""
        self._model, self._state, self._summary = model, b"", WearSummary(model.name)
        self._learnt = self._failed = False
        self.restart()

    def restart(self) -> None:
        """A new run of the clock: what was learnt stays."""
        self._waiting.clear()
        self._from, self._anew = None, True
        # What an order under way finds in the old run counts; learning is done anew.
        if not self._state:
            self._learnt, self._ordered = False, None

    def follow(self, last: int) -> None:
        """Order what is due after the sample `last` [ns]."""
        if not self.wanted or self._book.first is None:
            return
        if self._from is None:
            self._from = self._book.first
        end = last + self._period_ns + self._period_ns // 2
        if not self._learnt:
            self._learn(end)
        if self._state:
            period = round(self._parameters["monitor_period"] * SECOND)
            while end >= self._from + period:
                self._cut(self._from + period)
        self._next()

    def finish(self, last: int) -> None:
        """Look at what is left at the end of a run."""
        end = last + self._period_ns
        if self.wanted and self._state and self._from is not None and end > self._from:
            self._cut(end)
            self._next()

    def _learn(self, end: int) -> None:
        values = self._parameters
        bags, first = tuple(values["monitor_reference"]), self._from or 0
        stop = first if bags else first + round(values["monitor_learn"] * SECOND)
        if end < stop:
            return
        record = () if bags else (self._book.record(self._model, first, stop),)
        watches, vary = tuple(values["monitor"]), tuple(values["monitor_vary"])
        self._order(LearnJob(
            self._numbers(), stop, self._model, watches, vary, values["monitor_false_alarms"], record, bags,
        ))  # fmt: skip
        self._learnt, self._from = True, stop

    def _cut(self, stop: int) -> None:
        assert self._from is not None  # noqa: S101 - the callers have looked
        start = max(self._from - self._overlap, self._book.first or 0)
        self._waiting.append((stop, self._book.record(self._model, start, stop)))
        self._from = stop

    def _next(self) -> None:
        """One order at a time: each needs the monitor that the one before has left."""
        if self._ordered is None and self._waiting and self._state:
            stop, record = self._waiting.popleft()
            job = LookJob(self._numbers(), stop, self._state, record, self._anew, self._summary, self._settling)
            self._anew = False
            self._order(job)

    def _order(self, job: LearnJob | LookJob) -> None:
        self._ordered = job.number
        self._worker.submit(job)

    def take(self, answer: MonitorAnswer) -> None:
        """Take in what the worker found, tell it, and order what waits."""
        if answer.number != self._ordered:
            return
        self._ordered = None
        before, self._summary = self._summary, answer.summary
        self._state, self._settling = answer.state, answer.settling
        self._failed = not answer.state
        self._publish(encode_diagnostics(answer.stamp, wear_to_statuses(self._node, answer.summary)))
        self._tell(before)
        self._next()

    def _tell(self, before: WearSummary) -> None:
        summary = self._summary
        if summary.error:
            if summary.error != before.error:
                self._warn(f"wear: {summary.error}")
            return
        raised = {watch.parameter: watch.alarms for watch in before.watches}
        for watch in summary.watches:
            if watch.alarms > 0 and raised.get(watch.parameter, 0) == 0:
                self._warn(f"wear of {watch.parameter}: {watch.line}")
        if not before.watches:
            self._say(f"wear: {summary.reference:.4g} s of health show what is normal; {summary.line}")

    def health(self) -> list[Status]:
        """Return what is watched; nothing when nothing is."""
        if not self._parameters["monitor"]:
            return []
        summary = self._summary
        values = {watch.parameter: watch.line for watch in summary.watches}
        values |= {"waiting": str(len(self._waiting))}
        return [Status("wear", summary.line, Level(summary.level), values)]
