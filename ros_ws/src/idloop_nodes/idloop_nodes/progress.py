"""How far each node has come: start barrier, back-pressure and end of a run over one topic.

Messages on `progress` are headers. The frame holds the sender and an event:

- ``name/ready``: its streams are connected to those of all its peers,
- ``name``: it has processed everything up to this stamp,
- ``name/end``: there is nothing after this stamp,
- ``name/done``: it has processed everything, queued work included,
- ``name/experiment``: from this stamp on it plays an experiment,
- ``name/handed_back``: from this stamp on it plays the normal signal again, or nothing.
"""

from __future__ import annotations

from collections.abc import Iterable

from idloop.errors import IdloopError

REPORT_EVERY = 100  # samples after which a listener reports again; it reports its first sample at once
READY, END, DONE = "ready", "end", "done"
EXPERIMENT, HANDED_BACK = "experiment", "handed_back"


class Progress:
    """The messages on `progress` so far."""

    def __init__(self) -> None:
        self.ready: set[str] = set()
        self.done: set[str] = set()
        self.end: int | None = None
        self.experiment: tuple[int, int | None] | None = None  # stamps of the newest one: start, end once it is known
        self.reached: dict[str, int] = {}

    def update(self, stamp: int, frame: str) -> None:
        """Take in one message."""
        name, _, event = frame.partition("/")
        if event == READY:
            self.ready.add(name)
        elif event == DONE:
            self.done.add(name)
            self.reached[name] = max(stamp, self.reached.get(name, stamp))
        elif event == END:
            self.end = stamp
        elif event == EXPERIMENT:
            self.experiment = stamp, None
        elif event == HANDED_BACK:
            if self.experiment is not None:
                self.experiment = self.experiment[0], stamp
        else:
            self.reached[name] = max(stamp, self.reached.get(name, stamp))


def due(reported: int | None, reached: int, period_ns: int) -> bool:
    """Whether a listener that has reported the stamp `reported` is to report the one that it has reached now."""
    # A stamp before the reported one belongs to another run.
    return reported is None or not reported <= reached < reported + REPORT_EVERY * period_ns


class BackPressure:
    """Holds a sender back while a listener is too far behind."""

    def __init__(self, listeners: Iterable[str], window_ns: int, *, first_alone: bool = False) -> None:
        self.listeners = tuple(listeners)  # names of the nodes that must not lose anything
        self.window_ns = window_ns  # how far behind they may be
        # Nothing follows the first sample before all have confirmed it: one that is not connected yet misses nothing.
        self.first_alone = first_alone
        self.progress = Progress()
        self.waits = 0
        self._limit = -1

    def open(self, stamp: int, start: int) -> bool:
        """Whether `stamp` may be sent in a run that began at `start`."""
        if not self.listeners or stamp <= self._limit:
            return True
        if self.first_alone and self.unconfirmed():
            return stamp <= start
        reached = self.progress.reached
        slowest = min(reached.get(name, start) for name in self.listeners)
        self._limit = slowest + self.window_ns
        return stamp <= self._limit

    def slow(self, stamp: int, start: int) -> list[str]:
        """Listeners that hold `stamp` back in a run that began at `start`."""
        reached = self.progress.reached
        if self.first_alone and self.unconfirmed():
            return self.unconfirmed()
        return [name for name in self.listeners if stamp > reached.get(name, start) + self.window_ns]

    def unconfirmed(self) -> list[str]:
        """Listeners that have not confirmed any sample."""
        return [name for name in self.listeners if name not in self.progress.reached]

    def missing(self) -> list[str]:
        """Listeners that are not done."""
        return [name for name in self.listeners if name not in self.progress.done]

    def finished_by(self, limit: float, now: float, timeout: float) -> bool:
        """Whether every listener is done after the end of a run; IdloopError: the time `limit` is over."""
        missing = self.missing()
        if missing and now > limit:
            late = ", ".join(missing)
            raise IdloopError(f"{late} did not finish within {timeout:g} s after the end; raise drain_timeout")
        return not missing
