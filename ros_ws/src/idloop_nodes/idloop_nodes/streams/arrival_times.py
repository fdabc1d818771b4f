"""Log times that keep each topic in the order in which it was sent."""

from __future__ import annotations

from idloop_nodes.streams.stream_watch import JUMP_NS


class ArrivalTimes:
    """Times of arrival that never step back within a topic, unless the clock was set.

    What was lost on the way and came again arrived after its successors, and is handed out before them.
    """

    def __init__(self) -> None:
        self._newest: dict[str, int] = {}

    def of(self, topic: str, received: int) -> int:
        """Return the log time of the next message of a topic, handed out in order and received then [ns]."""
        newest = self._newest.get(topic, received)
        if newest - received < JUMP_NS:
            received = max(received, newest)
        self._newest[topic] = received
        return received
