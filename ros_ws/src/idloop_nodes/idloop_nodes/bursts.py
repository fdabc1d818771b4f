"""When a node that takes its samples in bursts looks for the next ones."""

from __future__ import annotations

ARRIVED = 0.4e-3  # seconds after the instant of a measurement at which it has come over to us as well
OTHER_CLOCK = 1.0  # seconds; a sample of this age was not late: its stamps are of another clock


class Bursts:
    """Instants of bursts: one costs as much as several samples, so few are cheap, and many are quick.

    Where stamps are of the clock that runs here, a burst comes just after a sample: at any other instant the newest
    would be older by up to a period.

    Parameters
    ----------
    length : float
        Time between two bursts, about [s].
    period : float
        Of the samples [s]; 0 where their clock is another one.

    Attributes
    ----------
    wait : float
        Time until the next burst [s].
    """

    def __init__(self, length: float, period: float = 0.0) -> None:
        self.wait = length
        self._length = length
        self._period = period
        self._samples = max(1, round(length / period)) if period else 0
        self._arrived = min(ARRIVED, 0.5 * period)
        self._next = 0.0

    def due(self, now: float) -> bool:
        """Whether it is time for a burst.

        Parameters
        ----------
        now : float
            Of a clock that never jumps [s].
        """
        self.wait = self._next - now
        return self.wait <= 0.0

    def plan(self, now: float, age: float | None = None) -> None:
        """Choose the next instant, after a burst.

        Parameters
        ----------
        now : float
            As for `due`.
        age : float, optional
            Time since the stamp of the newest sample by the clock that runs here [s]; None when the burst brought none.
        """
        self.wait = self._length
        if self._samples and age is not None and 0.0 <= age < OTHER_CLOCK:
            # After a long computation this lies in the past: what came meanwhile is taken at once.
            self.wait = max(self._samples * self._period + self._arrived - age, 0.0)
        self._next = now + self.wait
