"""How far everybody has come: start barrier, back-pressure and end of a run over one topic.

Messages on `progress` are headers. The frame says who speaks and what about:

- ``name/ready``: my streams are matched with those of all my peers,
- ``name``: I have dealt with everything up to this stamp,
- ``name/end``: there is nothing after this stamp,
- ``name/done``: I have dealt with everything, queued work included,
- ``name/experiment``: from this stamp on I play an experiment,
- ``name/handed_back``: from this stamp on I play the normal signal again, or nothing.
"""

from __future__ import annotations

from collections.abc import Iterable

REPORT_EVERY = 100  # samples after which a listener tells anew how far it is; the first one it tells at once
READY, END, DONE = "ready", "end", "done"
EXPERIMENT, HANDED_BACK = "experiment", "handed_back"


class Progress:
    """What has been said on `progress` so far."""

    def __init__(self) -> None:
        self.ready: set[str] = set()
        self.done: set[str] = set()
        self.end: int | None = None
        self.experiment: tuple[int, int | None] | None = None  # stamps of the newest one: start, end once it is known
        self.reached: dict[str, int] = {}

    def hear(self, stamp: int, frame: str) -> None:
        """Take in one message."""
        name, _, word = frame.partition("/")
        if word == READY:
            self.ready.add(name)
        elif word == DONE:
            self.done.add(name)
            self.reached[name] = max(stamp, self.reached.get(name, stamp))
        elif word == END:
            self.end = stamp
        elif word == EXPERIMENT:
            self.experiment = stamp, None
        elif word == HANDED_BACK:
            if self.experiment is not None:
                self.experiment = self.experiment[0], stamp
        else:
            self.reached[name] = max(stamp, self.reached.get(name, stamp))


def due(told: int | None, reached: int, period_ns: int) -> bool:
    """Whether a listener that has told of the stamp `told` tells of the one that it has reached now."""
    # A stamp before the told one belongs to another run.
    return told is None or not told <= reached < told + REPORT_EVERY * period_ns


class BackPressure:
    """Holds a sender back while a listener is too far behind.

    Parameters
    ----------
    listeners : iterable of str
        Names of the nodes that must not lose anything.
    window_ns : int
        How far behind they may be.
    first_alone : bool
        Nothing follows the first sample before all of them have told that they have it: whoever cannot hear the sender
        yet misses nothing.
    """

    def __init__(self, listeners: Iterable[str], window_ns: int, *, first_alone: bool = False) -> None:
        self.listeners = tuple(listeners)
        self.window_ns = window_ns
        self.first_alone = first_alone
        self.progress = Progress()
        self.waits = 0
        self._limit = -1

    def open(self, stamp: int, start: int) -> bool:
        """Whether `stamp` may be sent in a run that began at `start`."""
        if not self.listeners or stamp <= self._limit:
            return True
        if self.first_alone and self.unheard():
            return stamp <= start
        reached = self.progress.reached
        slowest = min(reached.get(name, start) for name in self.listeners)
        self._limit = slowest + self.window_ns
        return stamp <= self._limit

    def slow(self, stamp: int, start: int) -> list[str]:
        """Listeners that hold `stamp` back in a run that began at `start`."""
        reached = self.progress.reached
        if self.first_alone and self.unheard():
            return self.unheard()
        return [name for name in self.listeners if stamp > reached.get(name, start) + self.window_ns]

    def unheard(self) -> list[str]:
        """Listeners that have not told of any sample."""
        return [name for name in self.listeners if name not in self.progress.reached]

    def finished(self) -> bool:
        """Whether every listener has said that it is done."""
        return self.progress.done.issuperset(self.listeners)

    def missing(self) -> list[str]:
        """Listeners that have not said so."""
        return [name for name in self.listeners if name not in self.progress.done]
