"""What the estimator asks of its worker process, and how the worker is spoken to.

The worker is an ordinary child process with pickles on its pipes: it ends with its parent, and however
long a fit takes, the estimator's subscriptions are served.
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
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any

from idloop_nodes.codec import FitSummary, ParameterSummary

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

_LENGTH = struct.Struct("<Q")


@dataclass(frozen=True)
class FitJob:
    """Fit `model` to `fit_record`, judge it on `validation_record`."""

    number: int
    model: Model
    criterion: str
    fit_record: Record
    validation_record: Record
    fit_window: tuple[int, int]
    validation_window: tuple[int, int]


@dataclass(frozen=True)
class FitAnswer:
    """What came of a job; `parameters` is empty when the fit failed."""

    number: int
    summary: FitSummary
    parameters: tuple[ParameterSummary, ...]


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


class FitWorker:
    """A worker process that takes jobs one after the other.

    Parameters
    ----------
    queue_all : bool
        True works off every job (lock-step: equal runs give equal fits); False replaces a waiting job
        by a newer one (real time: only the newest window is of interest).
    """

    def __init__(self, queue_all: bool) -> None:
        self.skipped = 0
        self.failures = 0
        self._queue_all = queue_all
        self._waiting: list[FitJob] = []
        self._running: FitJob | None = None
        self._answers: queue.SimpleQueue[FitAnswer | None] = queue.SimpleQueue()
        self._process: subprocess.Popen[bytes] | None = None
        self._closing = False
        self._start()

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return self._running is not None or bool(self._waiting)

    def submit(self, job: FitJob) -> None:
        """Take in a job."""
        if not self._queue_all and self._waiting:
            self.skipped += len(self._waiting)
            self._waiting.clear()
        self._waiting.append(job)
        self._next()

    def answers(self) -> list[FitAnswer]:
        """Return what has been finished since the last call."""
        result: list[FitAnswer] = []
        while not self._answers.empty():
            answer = self._answers.get()
            if answer is None:
                self._lost_worker(result)
            else:
                result.append(answer)
                self._running = None
        self._next()
        return result

    def close(self) -> None:
        """End the worker."""
        self._closing = True
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

    def _lost_worker(self, result: list[FitAnswer]) -> None:
        if self._closing:
            return
        self.failures += 1
        if self._running is not None:
            summary = FitSummary(
                self._running.model.name,
                fit_window=self._running.fit_window,
                validation_window=self._running.validation_window,
                error="the worker process ended in the middle of the fit",
            )
            result.append(FitAnswer(self._running.number, summary, ()))
            self._running = None
        self._start()

    def _start(self) -> None:
        environment = dict(os.environ)
        # One thread: the other core belongs to the loop, and the sums come out the same every time.
        environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "idloop_nodes.fit_worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
        )
        self._listener = threading.Thread(target=self._listen, args=(self._process,), name="fits", daemon=True)
        self._listener.start()

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        while process.stdout is not None and (answer := receive(process.stdout)) is not None:
            self._answers.put(answer)
        self._answers.put(None)

    def _next(self) -> None:
        if self._running is not None or not self._waiting or self._process is None or self._process.stdin is None:
            return
        self._running = self._waiting.pop(0)
        with contextlib.suppress(OSError):  # the listener thread reports the loss of the worker
            send(self._process.stdin, self._running)
