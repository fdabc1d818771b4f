"""One thread that carries out orders one after the other and keeps the page's state up to date."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Any

from idloop.errors import IdloopError, InputError
from idloop.reporting.workbench.state import ERROR, WARN, Activity, Note, State
from idloop.worker_process import WorkerProcess

Job = Callable[[], None]


class Coordinator:
    """Takes orders from the page's threads; the work itself is done in a child process.

    Parameters
    ----------
    state : State
        Holds what goes on and what went wrong.
    """

    def __init__(self, state: State) -> None:
        self.state = state
        self.busy = ""
        self._worker = WorkerProcess("idloop page")
        self._quiet = False
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="workbench coordinator", daemon=True)
        self._thread.start()

    def order(self, what: str, job: Job, *, quiet: bool = False) -> None:
        """Queue a job; the reader sees `what` it is, unless it runs quietly.

        Raises
        ------
        InputError
            Another one is under way.
        """
        if self.busy:
            raise InputError(f"{self.busy} is under way: wait for its result")
        self.busy, self._quiet = what, quiet
        if not quiet:
            self.state.change(activity=Activity(what))
        self._jobs.put(job)

    def work(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Let the child do a piece of work; for jobs. Progress goes to the state."""
        what, quiet = self.busy, self._quiet

        def report(share: float, text: str) -> None:
            if not quiet:
                self.state.change(activity=Activity(f"{what}: {text}" if text else what, share))

        return self._worker.call(function, *arguments, report=report)

    def close(self) -> None:
        """End thread and child."""
        self._jobs.put(None)
        self._worker.close()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            try:
                job()
            except InputError as error:
                self.state.change(note=Note(str(error), WARN))
            except IdloopError as error:
                self.state.change(note=Note(str(error), ERROR))
            finally:
                quiet, self.busy = self._quiet, ""
                if not quiet:
                    self.state.change(activity=None)
