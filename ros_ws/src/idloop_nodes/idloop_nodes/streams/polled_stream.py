"""A raw subscription that its node reads when it wants to: many messages for one wake-up."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


class PolledStream:
    """Messages as bytes, taken in batches.

    Attributes: `topic`: fully qualified name; `received`: whether any message has arrived.
    """

    def __init__(self, subscription: Any) -> None:
        self.subscription = subscription
        self.received = False
        self.topic: str = subscription.topic_name
        self._type = subscription.msg_type

    def take(self, limit: int = 5000) -> Iterator[tuple[bytes, dict[str, Any]]]:
        """Yield (bytes, information) of what has arrived, at most `limit` messages."""
        handle = self.subscription.handle
        with handle:
            for _ in range(limit):
                taken = handle.take_message(self._type, True)
                if taken is None:
                    return
                self.received = True
                yield taken
