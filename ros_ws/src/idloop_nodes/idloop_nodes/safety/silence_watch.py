"""When a guardian sends in place of its bridge: when that is silent or gone. No ROS and no clock in here."""

from __future__ import annotations

AFTER_END_NS = 500_000_000  # time for which it sends in place of a bridge that has ended; then others may send


class SilenceWatch:
    """Decides what is sent in place of a bridge.

    `silence_ns`: time without a beat after which the bridge counts as hung [ns]. Attributes: `interventions`: how often
    it sent in place of the bridge; `longest_ns`: longest time between two beats [ns].
    """

    def __init__(self, silence_ns: int) -> None:
        self.interventions = 0
        self.longest_ns = 0
        self._silence_ns = silence_ns
        self._neutral = b""
        self._heard: int | None = None  # None without a bridge
        self._gone_at: int | None = None
        self._intervening = False

    @property
    def intervening(self) -> bool:
        """Whether it sends in place of the bridge."""
        return self._intervening

    def beat(self, now_ns: int, neutral: bytes) -> None:
        """Take in a beat and the message that stops the motor; empty when nothing is to be sent."""
        if self._heard is not None:
            self.longest_ns = max(self.longest_ns, now_ns - self._heard)
        self._heard, self._neutral = now_ns, neutral
        self._gone_at, self._intervening = None, False

    def gone(self, now_ns: int) -> None:
        """Take in that the bridge has ended."""
        self._heard, self._gone_at = None, now_ns

    def tick(self, now_ns: int) -> bytes:
        """Return what has to be sent now, empty for nothing."""
        hung = self._heard is not None and now_ns - self._heard > self._silence_ns
        leaving = self._gone_at is not None and now_ns - self._gone_at <= AFTER_END_NS
        intervening = bool(self._neutral) and (hung or leaving)
        self.interventions += intervening and not self._intervening
        self._intervening = intervening
        return self._neutral if intervening else b""
