"""The monitor: follows records of a machine and says what has grown, what has not, and what they cannot tell."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.monitoring.baseline import LEAST_SHARE, Baseline
from idloop.monitoring.block_scores import Evident, Scores
from idloop.monitoring.cusum import Alarm, Cusum, Growth
from idloop.monitoring.run_length import Evidence

if TYPE_CHECKING:
    from idloop.records import Record

Array = NDArray[np.float64]

ALARM, QUIET, CANNOT_TELL = "alarm", "quiet", "cannot_tell"


@dataclass(frozen=True)
class Trace:
    """What one stretch of data made of the sums.

    Attributes
    ----------
    index : array of int, shape (b,)
        Blocks.
    sums : array, shape (b, w)
        Sum of each watch after each block.
    growth, stderr : array, shape (b, w)
        Growth that each block shows by itself and its standard error [unit]; NaN where it tells nothing.
    alarms : tuple of (int, int, Alarm)
        Block, place of the watch, and the alarm, in the order of time.
    """

    index: NDArray[np.int64]
    sums: Array
    growth: Array
    stderr: Array
    alarms: tuple[tuple[int, int, Alarm], ...] = ()


@dataclass(frozen=True)
class WatchState:
    """What is known of one watch.

    Attributes
    ----------
    parameter, unit : str
    value : float
        Of the healthy machine: the model's, with what the reference corrected [unit].
    watched : float
        Growth that is to be noticed [unit].
    state : {"alarm", "quiet", "cannot_tell"}
    why : str
        Why it cannot tell; empty otherwise.
    alarms : tuple of Alarm
    growth : Growth or None
        What the newest blocks show.
    sum, threshold : float
        The CUSUM and where it alarms.
    blocks, telling : int
        Blocks seen, and those that told anything.
    delay : float
        Expected time from the watched growth to its alarm, in motions as in the data seen [s].
    reference_delay : float
        The same in motions as in the reference [s].
    """

    parameter: str
    unit: str
    value: float
    watched: float
    state: str
    why: str
    alarms: tuple[Alarm, ...]
    growth: Growth | None
    sum: float
    threshold: float
    blocks: int
    telling: int
    delay: float
    reference_delay: float


@dataclass
class Monitor:
    """A baseline and the sums of its watches.

    Attributes
    ----------
    baseline : Baseline
    sums : list of Cusum
        One for each watch.
    last : int or None
        Newest block that was taken in.
    """

    baseline: Baseline
    sums: list[Cusum] = field(default_factory=list)
    last: int | None = None

    def __post_init__(self) -> None:
        if not self.sums:
            self.sums = [Cusum() for _ in self.baseline.watches]

    def follow(self, record: Record) -> Trace:
        """Take in a stretch of data.

        Blocks that were taken in already are left out: a stretch may begin early, for the observer to settle.

        Parameters
        ----------
        record : Record
            Later than those before; its clock counts by ``start_ns``.

        Raises
        ------
        InputError
            The record does not suit the model or the reference.
        """
        return self.take(self.baseline.scores(record))

    def take(self, scores: Scores) -> Trace:
        """Take in the scores of a stretch, as `follow` does."""
        fresh = np.ones(len(scores), dtype=bool) if self.last is None else scores.index > self.last
        index = scores.index[fresh]
        shape = (len(index), len(self.sums))
        sums, growth, stderr = np.zeros(shape), np.full(shape, np.nan), np.full(shape, np.nan)
        alarms: list[tuple[int, int, Alarm]] = []
        for i, (normal, score) in enumerate(zip(self.baseline.normal, self.baseline.evident(scores), strict=True)):
            before = len(self.sums[i].alarms)
            part = Evident(score.gradient[fresh], score.information[fresh])
            sums[:, i] = self.sums[i].take(normal, index, part)
            alarms += [(alarm.block, i, alarm) for alarm in self.sums[i].alarms[before:]]
            tells = (part.information > LEAST_SHARE * normal.information) & (normal.information > 0.0)
            growth[tells, i] = (part.gradient[tells] / part.information[tells] - normal.offset) / normal.echo
            stderr[tells, i] = np.sqrt(normal.spread / part.information[tells]) / normal.echo
        if len(index):
            self.last = int(index[-1])
        return Trace(index, sums, growth, stderr, tuple(sorted(alarms, key=lambda one: one[:2])))

    def begin(self) -> None:
        """Another run of the clock follows; what was seen stays."""
        self.last = None

    def states(self) -> list[WatchState]:
        """What is known of each watch."""
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
        elif seen.telling == 0:
            state, why = CANNOT_TELL, f"the motion does not show {watch.parameter}: no block told anything"
        elif seen.blocks * self.baseline.block < delay:
            state = CANNOT_TELL
            why = (
                f"too little motion that shows {watch.parameter}: a growth of {watch.growth:.3g} {watch.unit} "
                f"would take {delay:.3g} s of it to alarm, {seen.blocks * self.baseline.block:g} s were seen"
            )
        return WatchState(
            parameter=watch.parameter,
            unit=watch.unit,
            value=watch.value + normal.offset / normal.echo,
            watched=watch.growth,
            state=state,
            why=why,
            alarms=tuple(seen.alarms),
            growth=seen.growth(normal),
            sum=seen.sum,
            threshold=normal.threshold,
            blocks=seen.blocks,
            telling=seen.telling,
            delay=delay,
            reference_delay=self.baseline.delay(i),
        )

    def _evidence(self, i: int) -> Evidence | None:
        """Evidence of the blocks seen, per block."""
        normal, seen = self.baseline.normal[i], self.sums[i]
        if normal.evidence is None or seen.information <= 0.0:
            return None
        alike = seen.information**2 / seen.squares
        ratio = (normal.echo * normal.watch.growth) ** 2 / (2.0 * normal.spread) * seen.information / alike
        return Evidence(ratio, alike / seen.blocks, alike)
