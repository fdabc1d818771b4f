"""Values that hold from their stamp on, looked up at rising times."""

from __future__ import annotations

from collections import deque


class HeldStream:
    """A stream of stamped values; what is older than the last question is forgotten.

    A value whose stamp is not newer than the last one replaces everything from its stamp on: a node
    that published ahead may so take back what it announced.
    """

    def __init__(self) -> None:
        self._values: deque[tuple[int, tuple[float, ...]]] = deque()
        self._current: tuple[int, tuple[float, ...]] | None = None

    def push(self, stamp: int, value: tuple[float, ...]) -> None:
        """Add a value that holds from `stamp` (nanoseconds) on."""
        values = self._values
        while values and values[-1][0] >= stamp:
            values.pop()
        values.append((stamp, value))

    def covers(self, stamp: int) -> bool:
        """Whether the value that holds at `stamp` is certain: a value of that time or later is here."""
        if self._values:
            return self._values[-1][0] >= stamp
        return self._current is not None and self._current[0] >= stamp

    def at(self, stamp: int) -> tuple[int, tuple[float, ...]] | None:
        """Return the value that holds at `stamp` with its own stamp, or None before the first."""
        values = self._values
        while values and values[0][0] <= stamp:
            self._current = values.popleft()
        return self._current

    def clear(self) -> None:
        """Forget everything."""
        self._values.clear()
        self._current = None

    @property
    def newest(self) -> int | None:
        """Stamp of the newest value, None when there is none."""
        if self._values:
            return self._values[-1][0]
        return None if self._current is None else self._current[0]
