"""The estimator's jobs for its worker process: however long a job takes, the subscriptions are served."""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass
from typing import Any, Protocol

from idloop.errors import IdloopError
from idloop.worker_process import Report, WorkerLostError, WorkerProcess

PROCESS_NAME = "estimator work"


class Job(Protocol):
    """Something for the worker to do; travels as a pickle."""

    @property
    def number(self) -> int:
        """Which job this is."""

    @property
    def replaceable(self) -> bool:
        """Whether a newer job of this kind makes it pointless while it waits."""

    def work(self, report: Report) -> Any:
        """Do it, in the worker, and return the answer."""

    def failed(self, reason: str) -> Any:
        """Return the answer of a job that could not be done: why, in one line."""


@dataclass(frozen=True)
class JobProgress:
    """How far a job is: share from 0 to 1, and what it does."""

    share: float
    text: str


class JobQueue:
    """Jobs that a worker process does one after the other.

    `keep_all`: True does every job (lock-step: equal runs give equal results); False lets a newer job replace a waiting
    one of its kind (real time: only the newest window is of interest). Attributes: `progress`: how far the running job
    is; `skipped`, `failures`: jobs that were replaced while they waited, and worker processes that were lost.
    """

    def __init__(self, *, keep_all: bool) -> None:
        self.skipped = 0
        self.failures = 0
        self.progress: JobProgress | None = None
        self._keep_all = keep_all
        self._waiting: list[Job] = []
        self._running: Job | None = None
        self._process = WorkerProcess(PROCESS_NAME)
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
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

    def submit(self, job: Job) -> None:
        """Take in a job."""
        if not self._keep_all and job.replaceable:
            keep = [one for one in self._waiting if not one.replaceable]
            self.skipped += len(self._waiting) - len(keep)
            self._waiting = keep
        self._waiting.append(job)
        self._next()

    def answers(self) -> list[Any]:
        """Return the answers since the last call."""
        result: list[Any] = []
        while not self._answers.empty():
            result.append(self._answers.get())
            self._running = self.progress = None
            self._next()
        return result

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
                answer = self._process.call(_work, job, report=self._take_progress)
            except IdloopError as error:
                self.failures += isinstance(error, WorkerLostError)
                answer = job.failed(str(error))
            self._answers.put(answer)

    def _take_progress(self, share: float, text: str) -> None:
        self.progress = JobProgress(share, text)


def _work(job: Job, report: Report) -> Any:
    return job.work(report)
