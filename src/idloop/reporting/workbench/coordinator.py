"""One thread that carries out orders one after the other and keeps the page's state up to date."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from idloop.errors import IdloopError, InputError
from idloop.reporting.workbench.state import ERROR, WARN, Activity, Note, State
from idloop.worker_process import WorkerProcess

Job = Callable[[], None]


class Coordinator:
    """Takes orders from the page's threads; the work itself is done in a child process.

    `state`: holds what goes on and what went wrong.
    `yields`: yield the processor to control loops; not where there are none and the reader waits.
    """

    def __init__(self, state: State, *, yields: bool = True) -> None:
        self.state = state
        self.busy = ""
        self._next = ""
        self._worker = WorkerProcess("idloop page", yields=yields)
        self._quiet = False
        self._jobs: queue.SimpleQueue[tuple[str, Job, bool] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="workbench coordinator", daemon=True)
        self._thread.start()

    def order(self, what: str, job: Job, *, quiet: bool = False, waits: bool = False) -> None:
        """Queue a job; the reader sees `what` it is, unless it runs quietly.

        `waits`: it may wait for another one that is under way, where none waits already.
        Raises InputError: another one is under way.
        """
        if self.busy and (self._next or not waits or what == self.busy):
            raise InputError(f"{self.busy} is under way: wait for its result")
        if self.busy:
            self._next = what
            if (now := self.state.snapshot.activity) is not None:
                self.state.change(activity=replace(now, then=what))
        else:
            self._begin(what, quiet=quiet)
        self._jobs.put((what, job, quiet))

    def _begin(self, what: str, *, quiet: bool) -> None:
        self.busy, self._quiet = what, quiet
        if not quiet:
            self.state.change(activity=Activity(what))

    def work(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Let the child do a piece of work; for jobs. Progress goes to the state."""
        what, quiet = self.busy, self._quiet

        def report(share: float, text: str) -> None:
            if not quiet:
                self.state.change(activity=Activity(f"{what}: {text}" if text else what, share, self._next))

        return self._worker.call(function, *arguments, report=report)

    def close(self) -> None:
        """End thread and child."""
        self._jobs.put(None)
        self._worker.close()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while (given := self._jobs.get()) is not None:
            what, job, quiet = given
            if self._next and what == self._next:
                self._next = ""
                self._begin(what, quiet=quiet)
            try:
                job()
            except InputError as error:
                self.state.change(note=Note(str(error), WARN))
            except IdloopError as error:
                self.state.change(note=Note(str(error), ERROR))
            finally:
                quiet = self._quiet
                # What waits goes on at once: nobody else can be let in between.
                self.busy = self._next
                if not quiet:
                    self.state.change(activity=Activity(self._next) if self._next else None)
