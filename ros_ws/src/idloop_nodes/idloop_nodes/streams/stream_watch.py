"""Whether a stream is alive, judged by a steady clock, and whether the clock of its stamps jumped."""

from __future__ import annotations

from enum import Enum

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

    `timeout_ns`: silence after which the stream counts as dead. Attributes: `jumps`, `stale`: how often a clock was
    set, and how many messages were left out.
    """

    def __init__(self, timeout_ns: int) -> None:
        self.timeout_ns = timeout_ns
        self.jumps = 0
        self.stale = 0
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
