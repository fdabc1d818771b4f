"""The clock with which a robot stamps its measurements, as seen from the local one.

Commands are stamped by the local clock, measurements by the robot's. Where the two differ, a command has to be stamped
in the clock of the robot, or motion and command would be apart by the difference.
"""

from __future__ import annotations

from idloop_nodes.streams.stream_watch import JUMP_NS

# A stamp this much older than its arrival, and none in the future, may be of our own clock [ns].
PLAUSIBLE_NS = 50_000_000
# The least delay of one such stretch and of the one before counts, so that a drifting clock is followed [ns].
STRETCH_NS = 10_000_000_000


class RobotClock:
    """Converts local time into the time of the robot's stamps."""

    def __init__(self) -> None:
        self._least: int | None = None
        self._before: int | None = None
        self._until = 0
        self._newest = 0

    def update(self, stamp_ns: int, now_ns: int) -> None:
        """Take in the stamp of a measurement, 0 where it has none, and its arrival."""
        if not stamp_ns:
            return
        behind = now_ns - stamp_ns
        if self._least is None or abs(behind - self.behind) >= JUMP_NS:
            self._least, self._before, self._until, self._newest = behind, None, now_ns + STRETCH_NS, 0
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
        if 0 <= self._newest - stamp < JUMP_NS:
            stamp = self._newest + 1
        self._newest = stamp
        return stamp
