"""What a bridge counts, as its health check of the streams."""

from __future__ import annotations

from idloop_nodes.codec import Level, Status
from idloop_nodes.streams.rates import RateCounter

FULL_LOAD = 0.9  # share of a processor core beyond which messages begin to wait


class BridgeCounters:
    """Measurements, commands and sent messages of a bridge.

    Attributes: `load`: processor time of the thread that forwards messages [s]; `unreadable`: messages that could not
    be read.
    """

    def __init__(self) -> None:
        self.measured, self.commanded, self.sent, self.load = (RateCounter() for _ in range(4))
        self.unreadable = 0

    def status(self, values: dict[str, str], commanders: int, problem: str) -> Status:
        """Return the check of the streams.

        `values`: further key values. `commanders`: nodes that publish commands. `problem`: error that goes before all
        others; empty when there is none.
        """
        rate, load = self.measured.rate(), self.load.rate()
        counts = {
            "measurements": str(self.measured.count),
            "measurement_rate": f"{rate:.1f}",
            "load": f"{load:.2f}",
            "commands": str(self.commanded.count),
            "command_rate": f"{self.commanded.rate():.1f}",
            "sent": str(self.sent.count),
            "sent_rate": f"{self.sent.rate():.1f}",
            "unreadable": str(self.unreadable),
            "commanders": str(commanders),
        }
        text, level = "ok", Level.OK
        if commanders > 1:
            text, level = f"{commanders} nodes publish joint_command", Level.WARN
        if load > FULL_LOAD:
            text, level = f"overloaded: this processor serves about {rate / load:.0f} measurements/s", Level.WARN
        if problem:
            text, level = problem, Level.ERROR
        return Status("streams", text, level, counts | values)
