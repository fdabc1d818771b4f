"""How fast simulated time may pass."""

from __future__ import annotations

SLACK = 0.1  # seconds that are made up for: what a late wake-up loses, not what a computation takes


class Pace:
    """Holds simulated time back to so many seconds in a second of the wall clock.

    What was lost while others held it back is not made up for: an experiment after a long computation would
    otherwise be over at once.

    `factor`: simulated seconds in a second, at most; 0 for as many as there can be.
    """

    def __init__(self, factor: float) -> None:
        self._factor = factor
        self._begun: float | None = None

    def early(self, simulated: float, now: float) -> bool:
        """Whether it is too early for this instant.

        `simulated`: time since the start of the run [s]; `now`: of a clock that never jumps [s].
        """
        if self._factor <= 0.0:
            return False
        due = simulated / self._factor
        if self._begun is None:
            self._begun = now - due
        behind = now - self._begun - due
        self._begun += max(behind - SLACK, 0.0)
        return behind < 0.0
