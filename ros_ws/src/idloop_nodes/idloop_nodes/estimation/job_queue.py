"""The estimator's jobs for its worker process: however long a job takes, the subscriptions are served."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from idloop.errors import IdloopError
from idloop.worker_process import Report, WorkerLostError, WorkerProcess

PROCESS_NAME = "estimator work"


@dataclass(frozen=True)
class Job:
    """Work for the worker process, and what receives its result, or the reason why there is none, in one line."""

    work: Callable[[Report], Any]  # travels as a pickle
    done: Callable[[Any], None]
    failed: Callable[[str], None]
    replaceable: bool  # a newer job of this kind makes it pointless while it waits


class JobQueue:
    """Jobs that a worker process does one after the other."""

    def __init__(self, *, keep_all: bool) -> None:
        # Jobs, those that were replaced while they waited, and worker processes that were lost
        self.submitted = self.skipped = self.failures = 0
        self.progress: tuple[float, str] | None = None  # of the running job: share from 0 to 1, and what it does
        # In lock-step every job is done: equal runs give equal results. In real time only the newest window counts.
        self._keep_all = keep_all
        self._waiting: list[Job] = []
        self._running: Job | None = None
        self._process = WorkerProcess(PROCESS_NAME)
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="jobs", daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return self._running is not None or bool(self._waiting)

    @property
    def pid(self) -> int | None:
        """Number of the worker process; None while it starts."""
        return self._process.pid

    def submit(
        self,
        work: Callable[[Report], Any],
        done: Callable[[Any], None],
        failed: Callable[[str], None],
        *,
        replaceable: bool = False,
    ) -> None:
        """Take in a job."""
        self.submitted += 1
        if not self._keep_all and replaceable:
            keep = [one for one in self._waiting if not one.replaceable]
            self.skipped += len(self._waiting) - len(keep)
            self._waiting = keep
        self._waiting.append(Job(work, done, failed, replaceable))
        self._next()

    def deliver(self) -> None:
        """Hand out the answers since the last call."""
        while not self._answers.empty():
            answer = self._answers.get()
            self._running = self.progress = None
            self._next()
            answer()

    def close(self) -> None:
        """End the worker process."""
        self._process.close()
        self._jobs.put(None)
        self._thread.join(timeout=1.0)

    def _next(self) -> None:
        if self._running is None and self._waiting:
            self._running = self._waiting.pop(0)
            self._jobs.put(self._running)

    def _run(self) -> None:
        self._process.start()  # its imports take a second: they are done before the first job
        while (job := self._jobs.get()) is not None:
            try:
                self._answers.put(partial(job.done, self._process.call(job.work, report=self._take_progress)))
            except IdloopError as error:
                self.failures += isinstance(error, WorkerLostError)
                self._answers.put(partial(job.failed, str(error)))

    def _take_progress(self, share: float, text: str) -> None:
        self.progress = share, text
