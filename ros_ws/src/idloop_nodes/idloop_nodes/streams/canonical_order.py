"""An order of messages that does not depend on when each happened to arrive."""

from __future__ import annotations

import heapq
from collections.abc import Sequence

# At equal times a reader meets a message before what it causes; results come last, whenever they were ready.
CAUSAL = ("reference", "excitation", "joint_states", "joint_command", "estimator/prediction", "estimator/residual")

Entry = tuple[int, int, int, bytes]  # stamp, rank of the topic, arrival, payload


def rank_topics(topics: Sequence[str]) -> dict[str, int]:
    """Return each topic's place among messages of one stamp."""
    rest = sorted(topic for topic in topics if topic not in CAUSAL)
    return {topic: place for place, topic in enumerate([*CAUSAL, *rest])}


class CanonicalOrder:
    """Sorts messages by stamp, then topic, with a delay that covers how far streams run apart.

    A message that was repeated, because its answer did not arrive, is kept once.
    """

    def __init__(self) -> None:
        self._heap: list[Entry] = []
        self._arrival = 0
        self._newest: tuple[int, int, bytes] | None = None

    def __len__(self) -> int:
        return len(self._heap)

    def add(self, stamp: int, rank: int, payload: bytes) -> None:
        """Take in one message."""
        self._arrival += 1
        heapq.heappush(self._heap, (stamp, rank, self._arrival, payload))

    def take(self, until: int | None = None) -> list[tuple[int, int, bytes]]:
        """Return (stamp, rank, payload) of everything before `until`, in order; everything when None."""
        result = []
        heap = self._heap
        while heap and (until is None or heap[0][0] < until):
            stamp, rank, _, payload = heapq.heappop(heap)
            one = stamp, rank, payload
            if one != self._newest:
                result.append(one)
            self._newest = one
        return result
