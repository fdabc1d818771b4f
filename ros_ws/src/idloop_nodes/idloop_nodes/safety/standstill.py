"""A process that was stopped until the others have removed its participant. No ROS and no clock in here."""

from __future__ import annotations

# Seconds of silence after which the middleware forgets a participant: leaseDuration in the profiles beside this file,
# and the default of Cyclone DDS. A node that was killed keeps its place as a publisher for so long.
LEASE = 10.0
# The newest announcement may have been under way for a while when the process was stopped.
MARGIN = 1.0
# A process that computes for a long time still announces itself: its middleware has threads of its own.
IDLE_SHARE = 0.2


class StandstillWatch:
    """Tells a stopped process (SIGSTOP, a frozen container) from a busy one.

    The middleware of a stopped process does not notice that the others have removed it, and what it had announced is
    not always announced again: observed as a controller that computes and whose commands the bridge never receives.
    Only a new participant is discovered for certain.

    `now`, `worked`: as of `forgotten`, before the participant is made.
    """

    def __init__(self, now: float, worked: float) -> None:
        self._now, self._worked = now, worked

    def forgotten(self, now: float, worked: float) -> bool:
        """Return whether the process has stood still since the last call for longer than the others wait.

        `now`: steady time [s]; `worked`: processor time of the process [s].
        """
        gap, work = now - self._now, worked - self._worked
        self._now, self._worked = now, worked
        return gap > LEASE - MARGIN and work < IDLE_SHARE * gap
