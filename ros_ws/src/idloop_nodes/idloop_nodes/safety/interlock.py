"""Whether anything may move: orders, what is latched, what is forbidden, and the watchdog of the streams."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Generic, TypeVar

from idloop.records.bags.cdr import SECOND
from idloop_nodes.streams.stream_watch import Arrival, StreamWatch

CREDIBLE = 1e100  # a larger measurement is none, and its products would overflow
AFTER_END_NS = SECOND // 2  # time for which the neutral command is repeated after deactivation; then others may send


Command = TypeVar("Command")


class Interlock(ABC, Generic[Command]):
    """Decides whether commands may pass, and says why not; what is sent then is up to the gate that is built on it.

    No ROS and no clock in here: every call receives the time. A command that is None: nothing has to be sent.

    `streams`: the watch of each stream that must be alive, the first one named first; `watchdog`: their timeout [s];
    `latch_watchdog`: what the watchdog finds stays until reset.

    Attributes: `active`: only an active gate lets commands pass; `reason`: why nothing passes, empty while commands do;
    `faults`: how often commands that passed were stopped; `latched`: what stays until reset, empty when nothing.
    """

    def __init__(self, streams: Mapping[str, StreamWatch], *, watchdog: float, latch_watchdog: bool) -> None:
        self.active = False
        self.reason = "inactive"
        self.faults = 0
        self._streams = streams
        self._watchdog = watchdog
        self._latch_watchdog = latch_watchdog
        self._unusable = dict.fromkeys(streams, "")
        self._breach = self.latched = ""
        self._forbidden: dict[str, str] = {}
        self._left_at: int | None = None

    # orders

    def forbid(self, source: str, reason: str) -> None:
        """Let no command pass for a reason that the gate cannot see, one of each source; empty: let them pass again."""
        self._forbidden[source] = reason

    @property
    def forbidden(self) -> str:
        """Why no command may pass although the streams are well; empty when there is no such reason."""
        return next(filter(None, self._forbidden.values()), "")

    def activate(self) -> None:
        """Let commands pass from the next one on, with a soft start."""
        self.active = True

    def deactivate(self, now_ns: int) -> Command | None:
        """Let nothing pass any more; return what has to be sent."""
        self._left_at = now_ns if self.active else self._left_at
        self.active = False
        return self._decide(now_ns)

    def stop(self, now_ns: int) -> Command | None:
        """Stop until reset; return what has to be sent."""
        self.latched = "emergency stop"
        return self._decide(now_ns)

    def reset(self) -> str:
        """Forget what was latched; return why that cannot be, empty when it could."""
        if not self._breach:
            self.latched = ""
        return self._breach

    def handed_over(self) -> None:
        """Take in that the newest neutral command was sent in place of this gate."""

    # decisions

    @abstractmethod
    def tick(self, now_ns: int) -> Command | None:
        """Advance the time; return what has to be sent."""

    @abstractmethod
    def neutral_command(self, now_ns: int) -> Command | None:
        """Return what has to be sent if no further call comes; None where the motor is not this gate's."""

    @abstractmethod
    def _decide(self, now_ns: int) -> Command | None:
        """Return what has to be sent now."""

    def blocked(self, now_ns: int) -> str:
        """Why nothing may pass; what stays until reset is latched on the way."""
        if not self.active:
            return "inactive"
        self.latched = self.latched or self._breach
        if self.latched:
            return self.latched
        if self.forbidden:
            return self.forbidden
        lost = self._lost(now_ns)
        if lost and self._latch_watchdog:
            self.latched = lost
        if lost:
            return lost
        missing = [name for name, watch in self._streams.items() if not watch.begun]
        return f"no {missing[0]} yet" if missing else ""

    def decided(self, reason: str) -> None:
        """Take in why nothing passes from now on; empty when commands do."""
        self.faults += bool(reason) and self.active and not self.reason
        self.reason = reason

    def take(self, stream: str, arrival: Arrival, **values: float | None) -> bool:
        """Take in the numbers of a message of a stream, not stale; return whether they can be used."""
        bound = CREDIBLE if stream == "measurement" else math.inf
        wrong = [n for n, v in values.items() if v is not None and not (math.isfinite(v) and abs(v) <= bound)]
        why = f"the {wrong[0]} is not finite" if wrong else ""
        self._unusable[stream] = f"the clock of the {stream} jumped" if arrival is Arrival.JUMP else why
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
