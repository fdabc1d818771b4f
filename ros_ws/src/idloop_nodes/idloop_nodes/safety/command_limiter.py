"""Limits of a motor's command: amplitude, rate, soft start, rms; and the work that was done by it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from idloop.records.bags.cdr import SECOND


@dataclass(frozen=True)
class CommandLimits:
    """Limits of a command, in its own unit."""

    command: float  # largest distance of the command from its base: from zero, or for a position from where the axis is
    rate: float | None = None  # largest change per second
    rms: float | None = None  # largest root of the low-pass filtered square, as a winding warms up
    rms_time: float = 10.0  # time constant of that filter [s]
    energy_time: float = 10.0  # time constant with which work is forgotten [s]
    soft_start: float = 1.0  # time in which the allowed command grows from nothing to `command` [s]
    standing: float = 0.05  # longest time for which a command holds without another check [s]


class CommandLimiter:
    """Tracks a motor's command and limits the next; never cleared: no motor cools down because of a service call."""

    def __init__(self, limits: CommandLimits) -> None:
        self.limits = limits
        self.work = 0.0
        self._mean_square = 0.0
        self._power = 0.0
        self._distance = 0.0
        self._velocity = 0.0
        self._output: float | None = None
        self._sent_at = 0
        self._now: int | None = None
        self._started: int | None = None

    @property
    def rms(self) -> float:
        """Root of the low-pass filtered square of the command."""
        return math.sqrt(self._mean_square)

    def start(self, now_ns: int) -> None:
        """Begin the soft start."""
        self._started = now_ns

    def advance(self, now_ns: int) -> None:
        """Advance the state to now."""
        if self._now is not None and now_ns > self._now:
            elapsed = (now_ns - self._now) / SECOND
            keep = math.exp(-elapsed / self.limits.rms_time)
            self._mean_square = keep * self._mean_square + (1.0 - keep) * self._distance**2
            keep = math.exp(-elapsed / self.limits.energy_time)
            self.work = keep * self.work + (1.0 - keep) * self.limits.energy_time * self._power
        self._now = now_ns

    def move(self, now_ns: int, velocity: float, base: float = 0.0) -> None:
        """Take in the velocity of the axis (NaN where it is unknown), and the base of its commands."""
        self.advance(now_ns)
        self._velocity = 0.0 if math.isnan(velocity) else velocity
        if self._output is not None:
            self._distance = self._output - base
        self._power = abs(self._distance * self._velocity)

    def limit(self, now_ns: int, wanted: float, base: float = 0.0) -> float:
        """Return the allowed command nearest to `wanted`."""
        self.advance(now_ns)
        last = base if self._output is None else self._output
        if self.limits.rate is not None:
            reach = self.limits.rate * (now_ns - self._sent_at) / SECOND if self._output is not None else 0.0
            wanted = min(max(wanted, last - reach), last + reach)
        bound = min(self.limits.command * self._opened(now_ns), self._warm_bound())
        return min(max(wanted, base - bound), base + bound)

    def sent(self, now_ns: int, output: float, base: float = 0.0) -> None:
        """Take in the command that was sent."""
        self.advance(now_ns)
        self._output, self._sent_at = output, now_ns
        self._distance = output - base
        self._power = abs(self._distance * self._velocity)

    def _opened(self, now_ns: int) -> float:
        """Part of the command that the soft start has opened."""
        if self._started is None:
            return 0.0
        if self.limits.soft_start <= 0.0:
            return 1.0
        return min(max((now_ns - self._started) / SECOND / self.limits.soft_start, 0.0), 1.0)

    def _warm_bound(self) -> float:
        """Largest command that keeps the rms within its limit while it holds."""
        if self.limits.rms is None:
            return math.inf
        keep = math.exp(-self.limits.standing / self.limits.rms_time)
        return math.sqrt(max(self.limits.rms**2 - keep * self._mean_square, 0.0) / (1.0 - keep))
