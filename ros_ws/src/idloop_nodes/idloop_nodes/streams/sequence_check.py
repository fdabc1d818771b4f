"""Counts what a stream has lost, from the numbers that its publishers gave to their messages.

The middleware's own message-lost event reports nothing when a reliable queue overflows.
"""

from __future__ import annotations

from typing import Any


class SequenceCheck:
    """Losses of one topic, each publisher on its own; where there are no numbers, stamps on a grid serve."""

    def __init__(self, period_ns: int) -> None:
        self.lost = 0
        self.received = 0
        self._period_ns = period_ns
        self._last: dict[bytes, int] = {}
        self._last_stamp: int | None = None

    def take(self, information: dict[str, Any], stamp: int) -> None:
        """Take in one message: what the middleware knows about it, and its stamp in nanoseconds."""
        self.received += 1
        number = information.get("publication_sequence_number")
        if number is not None:
            source = information.get("publisher_gid")
            key = bytes(source["data"]) if source else b""
            before = self._last.get(key)
            if before is not None and number > before + 1:
                self.lost += number - before - 1
            self._last[key] = number
            return
        if self._last_stamp is not None and self._period_ns:
            self.lost += max(0, round((stamp - self._last_stamp) / self._period_ns) - 1)
        self._last_stamp = stamp
