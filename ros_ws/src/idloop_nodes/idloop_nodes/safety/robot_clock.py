"""The clock that a robot stamps its measurements with, as it is seen from here.

What the robot is told is stamped here and what it measures over there. Where its clock is another one, the command has
to be stamped in it, or motion and command would lie apart by the difference of two clocks.
"""

from __future__ import annotations

# A stamp this much older than its arrival, and none in the future, may be of our own clock [ns].
PLAUSIBLE_NS = 50_000_000
# The least delay of one such stretch and of the one before counts, so that a drifting clock is followed [ns].
STRETCH_NS = 10_000_000_000
# From here on a stamp is of a clock that was set [ns].
JUMP_NS = 1_000_000_000


class RobotClock:
    """Turns our time into that of the robot's stamps."""

    def __init__(self) -> None:
        self._least: int | None = None
        self._before: int | None = None
        self._until = 0
        self._said = 0

    def hear(self, stamp_ns: int, now_ns: int) -> None:
        """Take in the stamp of a measurement, 0 where it has none, and when it came."""
        if not stamp_ns:
            return
        behind = now_ns - stamp_ns
        if self._least is None or abs(behind - self.behind) >= JUMP_NS:
            self._least, self._before, self._until, self._said = behind, None, now_ns + STRETCH_NS, 0
        elif now_ns >= self._until:
            self._least, self._before, self._until = behind, self._least, now_ns + STRETCH_NS
        else:
            self._least = min(self._least, behind)

    @property
    def behind(self) -> int:
        """How far the robot's stamps lie behind their arrival at the least [ns]; 0 before the first."""
        known = [one for one in (self._least, self._before) if one is not None]
        return min(known, default=0)

    @property
    def is_ours(self) -> bool:
        """Whether the robot may stamp with our own clock."""
        return 0 <= self.behind <= PLAUSIBLE_NS

    def stamp(self, now_ns: int) -> int:
        """Return our time in the robot's clock, never back by the little that an estimate changes [ns]."""
        stamp = now_ns if self.is_ours else now_ns - self.behind
        if 0 <= self._said - stamp < JUMP_NS:
            stamp = self._said + 1
        self._said = stamp
        return stamp
