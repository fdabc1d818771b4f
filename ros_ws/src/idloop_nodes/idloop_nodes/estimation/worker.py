"""The estimator's worker process and how it is spoken to.

The worker is an ordinary child process with pickles on its pipes: it ends with its parent, and however
long a job takes, the estimator's subscriptions are served.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import IO, Any, Protocol

_LENGTH = struct.Struct("<Q")

Report = Callable[[float, str], None]


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
class Note:
    """How far a job is."""

    number: int
    share: float
    text: str


def send(stream: IO[bytes], thing: object) -> None:
    """Write one pickle with its length."""
    data = pickle.dumps(thing)
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read one pickle; None when the other side has gone."""
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    data = stream.read(_LENGTH.unpack(head)[0])
    return pickle.loads(data)  # noqa: S301  (our own child)


class Worker:
    """A worker process that takes jobs one after the other.

    Parameters
    ----------
    queue_all : bool
        True works off every job (lock-step: equal runs give equal results); False lets a waiting job be replaced
        by a newer one of its kind (real time: only the newest window is of interest).

    Attributes
    ----------
    note : Note or None
        How far the running job is.
    """

    def __init__(self, *, queue_all: bool) -> None:
        self.skipped = 0
        self.failures = 0
        self.note: Note | None = None
        self._queue_all = queue_all
        self._waiting: list[Job] = []
        self._running: Job | None = None
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._process: subprocess.Popen[bytes] | None = None
        self._closing = False
        self._start()

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return self._running is not None or bool(self._waiting)

    def submit(self, job: Job) -> None:
        """Take in a job."""
        if not self._queue_all and job.replaceable:
            keep = [one for one in self._waiting if not one.replaceable]
            self.skipped += len(self._waiting) - len(keep)
            self._waiting = keep
        self._waiting.append(job)
        self._next()

    def answers(self) -> list[Any]:
        """Return what has been finished since the last call."""
        result: list[Any] = []
        while not self._answers.empty():
            answer = self._answers.get()
            if answer is None:
                self._lost(result)
            else:
                result.append(answer)
                self._running = None
                self.note = None
        self._next()
        return result

    def close(self) -> None:
        """End the worker."""
        self._closing = True
        self._end()

    def _end(self) -> None:
        process = self._process
        if process is None:
            return
        process.kill()
        process.wait()
        self._listener.join(timeout=1.0)
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):  # a job that the worker never read
                    stream.close()

    def _lost(self, result: list[Any]) -> None:
        if self._closing:
            return
        self.failures += 1
        if self._running is not None:
            result.append(self._running.failed("the worker process ended in the middle of it"))
            self._running = None
            self.note = None
        self._end()
        self._start()

    def _start(self) -> None:
        environment = dict(os.environ)
        # One thread: the other core belongs to the loop, and the sums come out the same every time.
        environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "idloop_nodes.estimation.worker_main"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
        )
        self._listener = threading.Thread(target=self._listen, args=(self._process,), name="worker", daemon=True)
        self._listener.start()

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        while process.stdout is not None and (answer := receive(process.stdout)) is not None:
            if isinstance(answer, Note):
                self.note = answer
            else:
                self._answers.put(answer)
        self._answers.put(None)

    def _next(self) -> None:
        if self._running is not None or not self._waiting or self._process is None or self._process.stdin is None:
            return
        self._running = self._waiting.pop(0)
        with contextlib.suppress(OSError):  # the listener thread reports the loss of the worker
            send(self._process.stdin, self._running)
