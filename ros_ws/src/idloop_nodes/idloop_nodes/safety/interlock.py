"""Whether anything may move: orders, what is latched, what is forbidden, and the watchdog of the streams.

No ROS and no clock in here: every call receives the time. What is sent where nothing may move is up to the gate that
is built on it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from idloop.records.bags.cdr import SECOND
from idloop_nodes.streams.stream_watch import Arrival, StreamWatch

CREDIBLE = 1e100  # a larger measurement is none, and its products would overflow
AFTER_END_NS = SECOND // 2  # time for which the neutral command is repeated after deactivation; then others may send


class Interlock:
    """Decides whether commands may pass, and says why not.

    `streams`: the watch of each stream that must be alive, the first one named first; `watchdog`: their timeout [s];
    `latch_watchdog`: what the watchdog finds stays until reset.

    Attributes: `active`: only an active gate lets commands pass; `reason`: why nothing passes, empty while commands do;
    `faults`: how often commands that passed were stopped.
    """

    def __init__(self, streams: Mapping[str, StreamWatch], *, watchdog: float, latch_watchdog: bool) -> None:
        self.active = False
        self.reason = "inactive"
        self.faults = 0
        self._streams = streams
        self._watchdog = watchdog
        self._latch_watchdog = latch_watchdog
        self._unusable = dict.fromkeys(streams, "")
        self._breach = self._latched = ""
        self._forbidden: dict[str, str] = {}
        self._left_at: int | None = None

    # orders

    def forbid(self, source: str, reason: str) -> None:
        """Let no command pass for a reason that the gate cannot see; an empty reason lets them pass again.

        `source`: origin of the reason: each has one at a time.
        """
        self._forbidden[source] = reason

    @property
    def forbidden(self) -> str:
        """Why no command may pass although the streams are well; empty when there is no such reason."""
        return next(filter(None, self._forbidden.values()), "")

    def activate(self) -> None:
        """Let commands pass from the next one on, with a soft start."""
        self.active = True

    def leave(self, now_ns: int) -> None:
        """Let nothing pass any more."""
        self._left_at = now_ns if self.active else self._left_at
        self.active = False

    def handed_over(self) -> None:
        """Take in that the newest neutral command was sent in place of this gate."""

    def latch_stop(self) -> None:
        """Let nothing pass until reset."""
        self._latched = "emergency stop"

    def reset(self) -> str:
        """Forget what was latched; return why that cannot be, empty when it could."""
        if self._breach:
            return self._breach
        self._latched = ""
        return ""

    @property
    def latched(self) -> str:
        """What stays until reset, empty when nothing."""
        return self._latched

    # decisions

    def blocked(self, now_ns: int) -> str:
        """Why nothing may pass; what stays until reset is latched on the way."""
        if not self.active:
            return "inactive"
        self._latched = self._latched or self._breach
        if self._latched:
            return self._latched
        if self.forbidden:
            return self.forbidden
        lost = self._lost(now_ns)
        if lost and self._latch_watchdog:
            self._latched = lost
        if lost:
            return lost
        missing = [name for name, watch in self._streams.items() if not watch.begun]
        return f"no {missing[0]} yet" if missing else ""

    def decided(self, reason: str) -> None:
        """Take in why nothing passes from now on; empty when commands do."""
        self.faults += bool(reason) and self.active and not self.reason
        self.reason = reason

    def take(self, stream: str, arrival: Arrival, **values: float | None) -> bool:
        """Take in the numbers of a message; return whether they can be used.

        `stream`: name of the stream; `arrival`: what the message is to it, not stale.
        """
        bound = CREDIBLE if stream == "measurement" else math.inf
        self._unusable[stream] = _why_unusable(arrival, stream, bound, **values)
        return not self._unusable[stream]

    def _lost(self, now_ns: int) -> str:
        """Return what the watchdog finds of streams that have begun."""
        for name, watch in self._streams.items():
            if watch.begun and watch.silent(now_ns):
                return f"no {name} for {self._watchdog:g} s"
        return next(filter(None, self._unusable.values()), "")

    def mine(self, now_ns: int) -> bool:
        """Whether the motor is this gate's: while it is active, and for a short time after."""
        return self.active or (self._left_at is not None and now_ns - self._left_at <= AFTER_END_NS)


def _why_unusable(arrival: Arrival, stream: str, bound: float, **values: float | None) -> str:
    """Return why a message cannot be used, empty when it can."""
    if arrival is Arrival.JUMP:
        return f"the clock of the {stream} jumped"
    for name, value in values.items():
        if value is not None and not (math.isfinite(value) and abs(value) <= bound):
            return f"the {name} is not finite"
    return ""
