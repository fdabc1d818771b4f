"""The monitor: processes records of a machine and states for each watch: alarm, quiet, or not decidable."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array, Integers
from idloop.monitoring.baseline import LEAST_SHARE, Baseline
from idloop.monitoring.block_scores import EfficientScore, Scores
from idloop.monitoring.cusum import Alarm, Cusum, Growth
from idloop.monitoring.run_length import Evidence

if TYPE_CHECKING:
    from idloop.records import Record


ALARM, QUIET, CANNOT_TELL = "alarm", "quiet", "cannot_tell"


@dataclass(frozen=True)
class Trace:
    """Sums and growth over one stretch of data."""

    index: Integers  # shape (b,): blocks
    sums: Array  # shape (b, w): sum of each watch after each block
    # shape (b, w): growth by each block alone and its standard error [unit]; NaN where a block is not informative
    growth: Array
    stderr: Array
    alarms: tuple[tuple[int, int, Alarm], ...] = ()  # block, place of the watch, and the alarm, in the order of time


@dataclass(frozen=True)
class WatchState:
    """Result of one watch."""

    parameter: str
    unit: str
    value: float  # of the healthy machine: the value of the model plus the offset of the reference [unit]
    watched: float  # growth to detect [unit]
    state: str  # {"alarm", "quiet", "cannot_tell"}
    why: str  # why no decision is possible; empty otherwise
    alarms: tuple[Alarm, ...]
    growth: Growth | None  # estimated from the newest blocks
    # The CUSUM and its alarm threshold
    sum: float
    threshold: float
    # Blocks processed, and the informative ones among them
    blocks: int
    telling: int
    delay: float  # expected time from the watched growth to its alarm, in motions as in the processed data [s]
    reference_delay: float  # the same in motions as in the reference [s]


@dataclass
class Monitor:
    """A baseline and the sums of its watches.

    Attributes
    ----------
    sums : list of Cusum
        One for each watch.
    last : int or None
        Newest block that was processed.
    """

    baseline: Baseline
    sums: list[Cusum] = field(default_factory=list)
    last: int | None = None

    def __post_init__(self) -> None:
        if not self.sums:
            self.sums = [Cusum() for _ in self.baseline.watches]

    def follow(self, record: Record) -> Trace:
        """Process a stretch of data.

        Blocks that were processed already are skipped: a stretch may begin early, for the observer to settle.

        Parameters
        ----------
        record : Record
            Later than those before, by its ``start_ns``.

        Raises
        ------
        InputError
            The record does not suit the model or the reference.
        """
        return self.take(self.baseline.scores(record))

    def take(self, scores: Scores) -> Trace:
        """Process the scores of a stretch, as `follow` does."""
        fresh = np.ones(len(scores), dtype=bool) if self.last is None else scores.index > self.last
        index = scores.index[fresh]
        shape = (len(index), len(self.sums))
        sums, growth, stderr = np.zeros(shape), np.full(shape, np.nan), np.full(shape, np.nan)
        alarms: list[tuple[int, int, Alarm]] = []
        for i, (normal, score) in enumerate(
            zip(self.baseline.normal, self.baseline.efficient_score(scores), strict=True)
        ):
            before = len(self.sums[i].alarms)
            part = EfficientScore(score.gradient[fresh], score.information[fresh])
            sums[:, i] = self.sums[i].take(normal, index, part)
            alarms += [(alarm.block, i, alarm) for alarm in self.sums[i].alarms[before:]]
            known = (part.information > LEAST_SHARE * normal.information) & (normal.information > 0.0)
            growth[known, i] = (part.gradient[known] / part.information[known] - normal.offset) / normal.sensitivity
            stderr[known, i] = np.sqrt(normal.variance_ratio / part.information[known]) / normal.sensitivity
        if len(index):
            self.last = int(index[-1])
        return Trace(index, sums, growth, stderr, tuple(sorted(alarms, key=lambda one: one[:2])))

    def begin(self) -> None:
        """Start another run of the clock; sums and counts stay."""
        self.last = None

    def states(self) -> list[WatchState]:
        """State of each watch."""
        return [self._state(i) for i in range(len(self.sums))]

    def _state(self, i: int) -> WatchState:
        normal, seen = self.baseline.normal[i], self.sums[i]
        watch = normal.watch
        evidence = self._evidence(i)
        delay = self.baseline.delay(i, evidence) if evidence is not None else float("inf")
        state, why = QUIET, ""
        if seen.alarms:
            state = ALARM
        elif normal.why:
            state, why = CANNOT_TELL, normal.why
        elif seen.informative == 0:
            state, why = CANNOT_TELL, f"the motion does not excite {watch.parameter}: no block is informative"
        elif seen.blocks * self.baseline.block < delay:
            state = CANNOT_TELL
            why = (
                f"too little data in which {watch.parameter} is excited: a growth of {watch.growth:.3g} {watch.unit} "
                f"takes {delay:.3g} s to alarm, {seen.blocks * self.baseline.block:g} s were processed"
            )
        return WatchState(
            parameter=watch.parameter,
            unit=watch.unit,
            value=watch.value + normal.offset / normal.sensitivity,
            watched=watch.growth,
            state=state,
            why=why,
            alarms=tuple(seen.alarms),
            growth=seen.growth(normal),
            sum=seen.sum,
            threshold=normal.threshold,
            blocks=seen.blocks,
            telling=seen.informative,
            delay=delay,
            reference_delay=self.baseline.delay(i),
        )

    def _evidence(self, i: int) -> Evidence | None:
        """Evidence of the processed blocks."""
        normal, seen = self.baseline.normal[i], self.sums[i]
        if normal.evidence is None or seen.information <= 0.0:
            return None
        alike = seen.information**2 / seen.squares
        ratio = (
            (normal.sensitivity * normal.watch.growth) ** 2 / (2.0 * normal.variance_ratio) * seen.information / alike
        )
        return Evidence(ratio, alike / seen.blocks, alike)
