"""The page's source on a live graph: orders go to the node's thread, computations to a process of their own."""

from __future__ import annotations

import queue
from collections.abc import Callable
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.reporting.workbench.assessment import FEWEST, assess, draw_characteristics
from idloop.reporting.workbench.coordinator import Coordinator
from idloop.reporting.workbench.files import content
from idloop.reporting.workbench.signals import SECOND, Signals
from idloop.reporting.workbench.state import AUTOMATIC, FREE, Snapshot, State

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

STOP = "stop"
REFRESH = 5 * SECOND  # of new samples after which a free run that somebody looks at is run anew


class LiveSource:
    """Implements `idloop.reporting.workbench.state.Source` on a live graph."""

    def __init__(self, model: Model, capacity: int, window: Callable[[], float]) -> None:
        self.signals = Signals(model, capacity)
        self.state = State(Snapshot(live=True, title=model.name, model=model, moves=True))
        self.requests: queue.SimpleQueue[tuple[str, str]] = queue.SimpleQueue()  # verb, and what it is about
        self._window = window  # returns the length of data that is assessed [s]
        self._coordinator = Coordinator(self.state)
        self._wanted: dict[str, None] = {}  # what is to be worked out, what has waited longest first

    @property
    def model(self) -> Model:
        """Newest one that is known; the page shows no number of another one."""
        model = self.state.snapshot.model
        assert model is not None  # noqa: S101 - it was given one
        return model

    @model.setter
    def model(self, model: Model) -> None:
        self.state.change(model=model)

    def file(self, name: str) -> bytes:
        """Content of a file, see `idloop.reporting.workbench.state.Source`."""
        return content(name, self.state.snapshot, None)

    def close(self) -> None:
        """End the process that computes."""
        self._coordinator.close()

    # the page's threads

    def order(self, verb: str, what: str = "") -> str:
        """Start an order, see `idloop.reporting.workbench.state.Source`."""
        if verb == "show":
            raise InputError("a live graph has no recordings to choose from")
        if verb == "assess":
            self.want("assess")
            return "looking again where the model fails"
        if verb == "automatic" and what not in {f"{one} {to}" for one in AUTOMATIC for to in ("on", "off")}:
            raise InputError(f"{what!r} is nothing that can be switched")
        if verb == "add" and not what:
            raise InputError("no effect is named")
        if verb == "experiment" and self.state.snapshot.stop != FREE:
            raise InputError("the motor is held by its stop: release the stop first")
        self.requests.put((verb, what))
        return "asked the graph"

    def stop(self) -> str:
        """Ask for the emergency stop."""
        self.requests.put((STOP, ""))
        return "emergency stop asked for"

    # the node's thread

    def want(self, what: str) -> None:
        """Note that ``assess`` or ``pictures`` is to be worked out as soon as there is time."""
        self._wanted.setdefault(what)

    def work(self) -> None:
        """Begin what is wanted, if nothing is under way; while somebody looks, the free run follows the data."""
        newest, found = self.signals.newest, self.state.snapshot.assessment
        behind = 0 if newest is None or found is None else newest - int(found.stamps[-1])
        if behind > REFRESH and self.state.looked_at:
            self.want("assess")
        if not self._wanted or self._coordinator.busy:
            return
        record = self._record()
        if record is None:
            return
        model, missing = self.model, self.state.snapshot.missing
        what = next(iter(self._wanted))
        del self._wanted[what]
        if what == "assess":
            self._coordinator.order("looking where the model fails", lambda: self._assess(model, record), quiet=True)
        elif missing is not None:
            candidates = missing.candidates
            self._coordinator.order(
                "characteristics",
                lambda: self.state.change(pictures=self._coordinator.work(draw_characteristics, candidates, record)),
                quiet=True,
            )

    def _assess(self, model: Model, record: Record) -> None:
        found = self._coordinator.work(assess, model, record)
        self.state.change(assessment=found)
        self.signals.show(found, every=False)

    def _record(self) -> Record | None:
        newest = self.signals.newest
        if newest is None:
            return None
        start = max(newest - round(self._window() * SECOND), self.signals.stamp(self.signals.span[0]))
        record = self.signals.record(self.model, start, newest + 1)
        # A command must hold from the first measurement on.
        return record if record.time.size >= FEWEST and record.input.size > 1 else None
