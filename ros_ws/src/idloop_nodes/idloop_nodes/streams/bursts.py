"""When a node that takes its samples in bursts takes the next ones."""

from __future__ import annotations

ARRIVED = 0.4e-3  # seconds after the instant of a measurement at which it has come over to us as well
LONGER = 0.001  # seconds by which bursts are drawn apart, or together again, at a time
LONGEST = 0.01  # seconds
MOST_SHARE, LITTLE_SHARE = 0.235, 0.2  # of a core: above it bursts are drawn apart, below it together
WEIGH_PERIOD = 0.5  # seconds over which the share is taken
OTHER_CLOCK = 1.0  # seconds; a sample of this age was not late: its stamps are of another clock


class Bursts:
    """Instants of bursts: one costs as much as several samples, so few are cheap, and many are quick.

    Where stamps are of the clock that runs here, a burst comes just after a sample: at any other instant the newest
    would be older by up to a period. Where the same work takes more of a core, because others crowd its caches or it
    runs on a slower machine, bursts are drawn apart until it takes less than a quarter of one.

    `length`: shortest time between two bursts, about [s]. `period`: of the samples [s]; 0 where their clock is another
    one. Attributes: `wait`: time until the next burst [s].
    """

    def __init__(self, length: float, period: float = 0.0) -> None:
        self.wait = length
        self._shortest = self._length = length
        self._period = period
        self._arrived = min(ARRIVED, 0.5 * period)
        self._next = 0.0
        self._weighed: tuple[float, float] | None = None

    def due(self, now: float) -> bool:
        """Whether it is time for a burst.

        `now`: of a clock that never jumps [s].
        """
        self.wait = self._next - now
        return self.wait <= 0.0

    def plan(self, now: float, age: float | None = None) -> None:
        """Choose the next instant, after a burst.

        `now`: as for `due`. `age`: time since the stamp of the newest sample by the clock that runs here [s]; None when
        the burst brought none.
        """
        self.wait = self._length
        if self._period and age is not None and 0.0 <= age < OTHER_CLOCK:
            # After a long computation this lies in the past: what came meanwhile is taken at once.
            samples = max(1, round(self._length / self._period))
            self.wait = max(samples * self._period + self._arrived - age, 0.0)
        self._next = now + self.wait

    def weigh(self, now: float, spent: float) -> None:
        """Draw the bursts apart or together by what the work takes.

        `now`: as for `due`; `spent`: processor time of the process so far [s].
        """
        if self._weighed is None:
            self._weighed = now, spent
            return
        passed = now - self._weighed[0]
        if passed < WEIGH_PERIOD:
            return
        share = (spent - self._weighed[1]) / passed
        self._weighed = now, spent
        if share > MOST_SHARE:
            self._length = min(self._length + LONGER, max(LONGEST, self._shortest))
        elif share < LITTLE_SHARE:
            self._length = max(self._length - LONGER, self._shortest)
