"""What the excitation sends, sample by sample: the normal signal, and experiments with smooth transitions."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from idloop.records.bags.cdr import SECOND
from idloop.signals import build_signal
from idloop_nodes.excitation.experiment import Experiment

Array = NDArray[np.float64]


def blend(start: float, end: float, seconds: float, sample_time: float) -> tuple[Array, Array]:
    """Return value and rate of a smooth move between two values; empty when there is nothing to bridge."""
    distance = end - start
    if seconds < sample_time or abs(distance) < 1e-12:
        return np.zeros(0), np.zeros(0)
    move = build_signal(
        "smooth",
        sample_time=sample_time,
        duration=seconds,
        amplitude=abs(distance),
        points=(float(np.sign(distance)),),
        velocity_limit=2.0 * abs(distance) / seconds,
        acceleration_limit=6.0 * abs(distance) / seconds**2,
        dwell=0.0,
    )
    rate = np.zeros_like(move.value) if move.rate is None else move.rate
    return start + move.value, rate


class ExcitationSequence:
    """Values of the normal signal (n,), and of experiments between, in the order in which they are announced."""

    def __init__(
        self, position: Array, velocity: Array, period_ns: int, *, keeps: bool, ahead: int, repeats: float | None = None
    ) -> None:
        self._keeps = keeps  # a signal that has ended stays at its value (a reference), else is zero
        # Begin again when the normal signal is over; where it keeps its value, on a smooth way back of so long [s]
        self.repeats = repeats
        self._period_ns = period_ns
        self._announced: deque[tuple[int, float]] = deque(maxlen=ahead + 2)
        # Stamps of the newest experiment's first sample and after its last one, the ways in and back outside
        self.span: tuple[int, int] | None = None
        self.load(position, velocity)

    def load(self, position: Array, velocity: Array) -> None:
        """Take another normal signal, from its beginning."""
        self._position, self._velocity = position, velocity
        self.restart()

    def restart(self) -> None:
        """Begin again with the normal signal."""
        self.index = 0  # samples of the normal signal that are out
        self._between: deque[tuple[float, float]] = deque()
        self._left = 0  # samples up to the end of an experiment that are not out yet
        self._own = 0  # samples of the experiment itself

    def forget(self) -> None:
        """Begin again in a new run of the clock."""
        self.restart()
        self._announced.clear()
        self.span = None

    @property
    def length(self) -> int:
        """Samples of the normal signal."""
        return len(self._position)

    @property
    def peak(self) -> float:
        """Largest absolute value of the normal signal."""
        return float(np.max(np.abs(self._position)))

    @property
    def playing(self) -> bool:
        """Whether samples of an experiment are still to be announced."""
        return self._left > 0

    def next(self, stamp: int, active: bool) -> tuple[float, float]:
        """Return value and rate of the sample announced for `stamp`."""
        value, rate = self._next(active)
        self._announced.append((stamp, value))
        if self._left and self.span is not None:
            self._left -= 1
            # A node that was held up leaves samples out: the experiment then comes later.
            end = stamp + (self._left + 1) * self._period_ns
            begun = self._left < self._own
            self.span = self.span[0] if begun else end - self._own * self._period_ns, end
        return value, rate

    def _next(self, active: bool) -> tuple[float, float]:
        if active and self._between:
            return self._between.popleft()
        if active and self.index == self.length and self.repeats is not None:
            self.index = 0
            if self._keeps:
                self._hand_over(self._newest, float(self._position[0]), self.repeats)
                return self._next(active)
        if active and self.index < self.length:
            self.index += 1
            return float(self._position[self.index - 1]), float(self._velocity[self.index - 1])
        return self._rest, 0.0

    @property
    def _newest(self) -> float:
        return self._announced[-1][1] if self._announced else 0.0

    @property
    def _rest(self) -> float:
        return self._newest if self._keeps else 0.0

    @property
    def _resumes_at(self) -> float:
        """Value at which the normal signal goes on."""
        if self.index < self.length:
            return float(self._position[self.index])
        if self.repeats is not None:
            return float(self._position[0])
        return float(self._position[-1]) if self._keeps else 0.0

    def begin(self, experiment: Experiment, handover: float, rest: float, stamp: int) -> tuple[int, int]:
        """Put an experiment in behind what is announced, after a `rest`, with smooth ways; return its span."""
        step, first, last = experiment.sample_time, float(experiment.value[0]), float(experiment.value[-1])
        still = first if self._keeps else 0.0
        waiting = np.full(round(rest / step), still)
        before = [blend(self._newest, still, handover, step), (waiting, np.zeros_like(waiting))]
        parts = [*before, (experiment.value, experiment.rate), blend(last, self._resumes_at, handover, step)]
        for value, rate in parts:
            self._between.extend(zip(value.tolist(), rate.tolist(), strict=True))
        start = stamp + sum(len(value) for value, _ in before) * self._period_ns
        self.span = start, start + len(experiment.value) * self._period_ns
        self._left, self._own = len(self._between) - len(parts[-1][0]), len(experiment.value)
        return self.span

    def take_back(self, now: int) -> None:
        """Forget what was announced for after `now`: the next value follows the one in force."""
        while len(self._announced) > 1 and self._announced[-1][0] > now:
            self._announced.pop()

    def cut(self, now: int, handover: float) -> int | None:
        """End an experiment at `now`, with a smooth way back, to be announced again; return the stamp of its end."""
        stop = now + self._period_ns
        if self.span is None or stop >= self.span[1]:
            return None
        self.take_back(now)
        self.span = min(self.span[0], stop), stop
        self._left = 0
        self._hand_over(self._newest, self._resumes_at, handover)
        return stop

    def _hand_over(self, start: float, end: float, seconds: float) -> None:
        """Put a smooth way from one value to another in."""
        value, rate = blend(start, end, seconds, self._period_ns / SECOND)
        self._between = deque(zip(value.tolist(), rate.tolist(), strict=True))
