"""Which of two nodes of one name came second: that one ends, for two graphs in one domain would mix up."""

from __future__ import annotations

NEW = 1.0  # seconds before which a node that meets another of its name is the one that has come to it
LOOK_AROUND = 1.0  # seconds after its start in which a node hears of whoever is there: two announcements of theirs


class TwinWatch:
    """What a node knows of others of its name.

    Parameters
    ----------
    now : float
        When the node was made, of a clock that never jumps [s].
    look_around : float
        How long it waits from then on for others to become known [s].
    """

    def __init__(self, now: float, look_around: float) -> None:
        self._looks_until = now + look_around
        self._ready: float | None = None
        self._heard = 0
        self._known: float | None = None

    def alone(self, namesakes: int, now: float) -> bool:
        """Whether no other can be there that would still speak up.

        Parameters
        ----------
        namesakes : int
            How many nodes of this name are known, this one among them. A dead one is known for a while.
        now : float
            [s].
        """
        if now < self._looks_until:
            return False
        if namesakes < 2:
            return True
        self._known = now if self._known is None else self._known
        return now - self._known >= NEW

    def ready(self, now: float) -> None:
        """Remember that this node says now that it is ready."""
        self._ready = now

    def second(self, now: float) -> bool:
        """Take in that a node of this name has said that it is ready; return whether this one has come to it.

        Who is there for longer goes on. What a dead one has said nobody hears.
        """
        self._heard += 1
        if self._ready is None:
            return True
        return self._heard > 1 and now - self._ready < NEW
