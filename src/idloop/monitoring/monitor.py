"""The monitor: Page's CUSUM of each watch over records of a machine: alarm, quiet, or not decidable."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array, Integers
from idloop.monitoring.baseline import LEAST_SHARE, Baseline, ReferenceStatistics
from idloop.monitoring.block_scores import EfficientScore
from idloop.monitoring.run_length import FEWEST_BLOCKS, Evidence

if TYPE_CHECKING:
    from idloop.records import Record


_WIDTH = 1.959963984540054
# The newest growth is estimated from so many blocks that its standard error is this share of the watched growth.
_SHARP = 0.2


@dataclass(frozen=True)
class Growth:
    """Change of a parameter against the healthy machine, with a 95 % interval [unit]."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Alarm:
    """One alarm."""

    block: int  # at the end of which it was raised
    onset: int  # first block after the sum was last 0: the maximum-likelihood estimate of the change time
    # From the onset to the alarm. Biased upwards by the selection of an alarm; `Cusum.growth` is not.
    growth: Growth


@dataclass
class Cusum:
    """State of one watch."""

    sum: float = 0.0  # sum of log-likelihood ratios since the onset
    onset: int | None = None  # first block since the sum was last 0; None while it is 0
    # In order. After each the sum restarts, so that a lasting growth raises another alarm.
    alarms: list[Alarm] = field(default_factory=list)
    # Blocks processed, and the informative ones among them
    blocks: int = 0
    informative: int = 0
    information: float = 0.0  # of all blocks [1/unit²]
    squares: float = 0.0  # sum of the squared information [1/unit⁴]
    _since: tuple[float, float] = (0.0, 0.0)
    _newest: deque[tuple[float, float]] = field(default_factory=deque)
    _held: tuple[float, float] = (0.0, 0.0)

    def take(self, normal: ReferenceStatistics, index: Integers, score: EfficientScore) -> list[float]:
        """Process blocks in the order of time.

        `normal`: reference statistics of this watch; `index` (b,). Returns: sum after each block, before the restart at
        an alarm.
        """
        least = LEAST_SHARE * normal.information
        sums = []
        columns = (index, normal.ratio(score), score.gradient, score.information)
        for block, ratio, gradient, information in zip(*(one.tolist() for one in columns), strict=True):
            self.blocks += 1
            if normal.evidence is not None and information > least:
                self._add(normal, block, ratio, gradient - information * normal.offset, information)
            sums.append(self.sum)
            if self.sum > normal.threshold:
                onset = block if self.onset is None else self.onset
                self.alarms.append(Alarm(block, onset, _estimate(normal, *self._since)))
                self._restart()
        return sums

    def _add(self, normal: ReferenceStatistics, block: int, ratio: float, gradient: float, information: float) -> None:
        self.informative += 1
        self.information += information
        self.squares += information**2
        self.sum += min(ratio, normal.threshold / FEWEST_BLOCKS)
        if self.sum <= 0.0:
            self._restart()
        else:
            self.onset = block if self.onset is None else self.onset
            self._since = self._since[0] + gradient, self._since[1] + information
        self._newest.append((gradient, information))
        self._held = self._held[0] + gradient, self._held[1] + information
        enough = normal.variance_ratio / (_SHARP * normal.sensitivity * normal.watch.growth) ** 2
        while len(self._newest) > 1 and self._held[1] - self._newest[0][1] >= enough:
            old = self._newest.popleft()
            self._held = self._held[0] - old[0], self._held[1] - old[1]

    def _restart(self) -> None:
        self.sum, self.onset, self._since = 0.0, None, (0.0, 0.0)

    def growth(self, normal: ReferenceStatistics) -> Growth | None:
        """Growth estimated from the newest blocks; None before the first informative one."""
        return _estimate(normal, *self._held) if self._held[1] > 0.0 else None


def _estimate(normal: ReferenceStatistics, gradient: float, information: float) -> Growth:
    """Estimate of the change with its interval, which includes the uncertainty of the reference."""
    value = gradient / max(information, 1e-300) / normal.sensitivity
    own = np.sqrt(normal.variance_ratio / max(information, 1e-300))
    width = _WIDTH * float(np.hypot(own, normal.offset_stderr)) / normal.sensitivity
    return Growth(value, value - width, value + width)


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
    """A baseline and the sums of its watches."""

    baseline: Baseline
    sums: list[Cusum] = field(default_factory=list)  # one for each watch
    last: int | None = None  # newest block that was processed

    def __post_init__(self) -> None:
        if not self.sums:
            self.sums = [Cusum() for _ in self.baseline.watches]

    def follow(self, record: Record) -> Trace:
        """Process a stretch of data, later than those before by its ``start_ns``.

        Blocks that were processed already are skipped: a stretch may begin early, for the observer to settle.
        Raises InputError: the record does not suit the model or the reference.
        """
        scores = self.baseline.scores(record)
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
        watch, delay = normal.watch, float("inf")
        if normal.evidence is not None and seen.information > 0.0:
            # As for the reference: blocks of equal information that are worth as much.
            alike = seen.information**2 / seen.squares
            size = (normal.sensitivity * watch.growth) ** 2 / (2.0 * normal.variance_ratio)
            delay = self.baseline.delay(i, Evidence(size * seen.information / alike, alike / seen.blocks, alike))
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
