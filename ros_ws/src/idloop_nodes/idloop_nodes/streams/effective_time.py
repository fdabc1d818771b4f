"""When a command of a real-time graph takes effect."""

from __future__ import annotations

from idloop.errors import InputError
from idloop.records.bags.cdr import SECOND
from idloop_nodes.streams.stream_watch import JUMP_NS


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
