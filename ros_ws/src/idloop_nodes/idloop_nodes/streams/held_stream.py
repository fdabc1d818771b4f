"""Streams that a node reads when it wants to, and the value that holds at a time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

PERIODS = 100  # after which a missing command no longer holds a measurement up
SILENCE = 1.0  # seconds without any command: in simulated time only this tells a missing one from a late one
EVER = 1 << 62  # later than any stamp


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


class PolledStream:
    """Messages as bytes, taken in batches; `received`: whether any has arrived."""

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


class CommandWait:
    """Stamps up to which the commands are known, or will not be known any more.

    In real time a measurement that is a hundred periods old has waited long enough. In lock-step nothing runs ahead of
    the commands, however long they take, so that equal runs give equal results; only a recording that lacks commands
    shows measurements far beyond the last one, or its end, and then nothing comes.
    """

    def __init__(self, period_ns: int, lockstep: bool, now: float) -> None:
        self._patience = PERIODS * period_ns
        self._lockstep = lockstep
        self._newest = now  # of a clock that never jumps [s]

    def update(self, now: float) -> None:
        """Note that a command has come."""
        self._newest = now

    def known_until(self, command: int | None, output: int, end: int | None, now: float) -> int:
        """Newest stamp whose command is settled, of newest command and measurement, and the end of the run [ns]."""
        given_up = output - self._patience
        if self._lockstep and now - self._newest < SILENCE:
            given_up = -1
        elif end is not None and output >= end and now - self._newest >= SILENCE:
            given_up = EVER
        return given_up if command is None else max(command, given_up)
