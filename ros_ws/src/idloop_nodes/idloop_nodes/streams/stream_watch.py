"""What a stream's stamps show: whether it is alive, whether a clock was set, what was lost, when a command holds."""

from __future__ import annotations

from enum import Enum
from typing import Any

from idloop.errors import InputError
from idloop.records.bags.cdr import SECOND

JUMP_NS = 1_000_000_000  # a stamp this far from the last one means that a clock was set


class Arrival(Enum):
    """What a message is to its stream."""

    FRESH = "fresh"
    STALE = "stale"
    JUMP = "jump"


class StreamWatch:
    """The watchdog of one stream; stamps are compared with stamps only, silence is measured by arrivals.

    A message without a stamp (0) is fresh whenever it comes. One that repeats a stamp or lies behind the last is stale,
    as after a duplicate or a change of order, and does not count as a sign of life. One that lies a second or more
    away in either direction, while the stream was not silent, shows that a clock was set. After a silence any other
    stamp is a new beginning.
    """

    def __init__(self, timeout_ns: int) -> None:
        self.timeout_ns = timeout_ns  # silence after which the stream counts as dead
        self.jumps = 0  # how often a clock was set
        self.stale = 0  # messages that were left out
        self._arrived: int | None = None
        self._stamp = 0

    def update(self, now_ns: int, stamp_ns: int) -> Arrival:
        """Take in one message: the steady time of its arrival, and its stamp (0 when it has none)."""
        step = stamp_ns - self._stamp
        stamped = stamp_ns != 0 and self._stamp != 0
        comparable = stamped and not self.silent(now_ns)
        if (comparable and -JUMP_NS < step < 0) or (stamped and step == 0):
            self.stale += 1
            return Arrival.STALE
        self._arrived = now_ns
        self._stamp = stamp_ns or self._stamp
        if comparable and abs(step) >= JUMP_NS:
            self.jumps += 1
            return Arrival.JUMP
        return Arrival.FRESH

    def silent(self, now_ns: int) -> bool:
        """Whether nothing fresh has come for longer than the timeout."""
        return self._arrived is None or now_ns - self._arrived > self.timeout_ns

    @property
    def begun(self) -> bool:
        """Whether any message has arrived."""
        return self._arrived is not None


def effective_time(stamp: int, received: int, now: int) -> int:
    """Return when a command takes effect: at its stamp, or on arrival when it is late.

    `stamp`, `received`: of the command, by the clock of the system [ns]; `now`: the plant's own time, which goes on
    evenly when that clock is set [ns]. Raises InputError: it would hold up all that follow: of an unknown sender, or
    from a clock that was set.
    """
    if abs(received - now) >= JUMP_NS:
        received = now
    if stamp - received >= JUMP_NS:
        raise InputError(f"a command for {(stamp - received) / SECOND:.0f} s ahead")
    return max(stamp, received)


class ArrivalTimes:
    """Times of arrival that never step back within a topic, though what was lost on the way came again later."""

    def __init__(self) -> None:
        self._newest: dict[str, int] = {}

    def of(self, topic: str, received: int) -> int:
        """Return the log time of the next message of a topic, handed out in order and received then [ns]."""
        newest = self._newest.get(topic, received)
        if newest - received < JUMP_NS:
            received = max(received, newest)
        self._newest[topic] = received
        return received


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
