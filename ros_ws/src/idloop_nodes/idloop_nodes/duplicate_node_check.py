"""Which of two nodes of one name came second: that one ends, because two graphs in one domain would mix up."""

from __future__ import annotations

NEW = 1.0  # seconds after its announcement in which a node that meets another of its name counts as the second
DISCOVERY_TIME = 1.0  # seconds after its start in which a node discovers the others: two of their announcements


class DuplicateNodeCheck:
    """What a node knows of others of its name.

    `now`: time at which the node was made, of a clock that never jumps [s]; `discovery_time`: time from then on in
    which others may still be discovered [s].
    """

    def __init__(self, now: float, discovery_time: float) -> None:
        self._discovered_at = now + discovery_time
        self._announced: float | None = None
        self._announcements = 0
        self._known: float | None = None

    def is_unique(self, count: int, now: float) -> bool:
        """Whether no other node of this name will announce itself.

        `count`: known nodes of this name, this one included. A dead node stays known for a while. `now`: [s].
        """
        if now < self._discovered_at:
            return False
        if count < 2:
            return True
        self._known = now if self._known is None else self._known
        return now - self._known >= NEW

    def announced(self, now: float) -> None:
        """Remember that this node announces itself now."""
        self._announced = now

    def is_second(self, now: float) -> bool:
        """Take in an announcement of a node of this name; return whether this node is the second one.

        The node that has run for longer goes on. The announcements of a dead node are not delivered any more.
        """
        self._announcements += 1
        if self._announced is None:
            return True
        return self._announcements > 1 and now - self._announced < NEW
