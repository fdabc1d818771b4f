"""A process that computes while another one stays responsive: one call after the other."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import threading
import time
import traceback
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from idloop.errors import IdloopError, InputError

NICENESS = 10  # the work may take longer; a control loop on the same machine may not
REPORT_PERIOD = 0.1  # seconds between two reports
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_SET_PARENT_DEATH_SIGNAL, _SET_NAME = 1, 15  # prctl(2)

Report = Callable[[float, str], None]


class WorkerLostError(IdloopError):
    """The process ended in the middle of a call."""


class WorkerProcess:
    """One child process, started with the first call and again after it was lost.

    Functions and their arguments travel as pickles. Any thread may close it for good, also during a call.

    `name`: name of the process, as `top` shows it (at most 15 characters).
    `yields`: yield the processor to control loops; not where the user waits for the result.
    """

    def __init__(self, name: str = "idloop worker", *, yields: bool = True) -> None:
        self._name, self._yields = name, yields
        self._calling = threading.Lock()  # its holder alone uses the pipe
        self._changing = threading.Lock()
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None
        self._closed = False

    @property
    def pid(self) -> int | None:
        """Number of the child; None while there is none."""
        process = self._process
        return None if process is None else process.pid

    def start(self) -> None:
        """Start the child before the first call needs it; the calling thread must live as long as the child."""
        with self._calling:
            self._ready()

    def call(self, function: Callable[..., Any], *arguments: Any, report: Report = lambda share, text: None) -> Any:
        """Run ``function(*arguments, report)`` in the child and return what it returns.

        Raises InputError, IdloopError: as the function did; any other error becomes an IdloopError.
        Raises WorkerLostError: the child was lost or closed.
        """
        with self._calling:
            pipe = self._ready()
            try:
                pipe.send((function, arguments))
                while True:
                    kind, content = pipe.recv()
                    if kind == "report":
                        report(*content)
                    elif kind == "result":
                        return content
                    elif kind == "bad input":
                        raise InputError(content)
                    else:
                        raise IdloopError(content)
            except (EOFError, OSError) as error:
                self._lose()
                raise WorkerLostError("the worker process ended in the middle of its work") from error

    def _ready(self) -> Connection:
        if self._pipe is not None and self._process is not None and self._process.is_alive():
            return self._pipe
        self._lose()
        with self._changing:
            if self._closed:
                raise WorkerLostError("the worker process has been ended")
            # A fresh interpreter: a copy of this one would hold its sockets and half of its threads.
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            arguments = (theirs, self._name, self._yields)
            self._process = context.Process(target=serve, args=arguments, name=self._name, daemon=True)
            self._process.start()
            theirs.close()
            return self._pipe

    def _lose(self) -> None:
        """Leave nothing of a child behind; only for the holder of the right to call."""
        with self._changing:
            process, pipe = self._process, self._pipe
            self._process = self._pipe = None
        if process is not None:
            process.kill()
            process.join(timeout=5.0)
        if pipe is not None:
            pipe.close()

    def close(self) -> None:
        """End the child, whatever it does, and start none any more."""
        with self._changing:
            self._closed = True
            if self._process is not None:
                self._process.kill()  # a thread that waits for it now finds its end of the pipe closed
        with self._calling:
            self._lose()


def serve(pipe: Connection, name: str, yields: bool = True) -> None:
    """Work until the other side has ended."""
    _end_with_parent(name)
    if yields:
        _yield_processor()
    # One thread: the other cores belong to the parent, and sums come out the same every time.
    os.environ |= dict.fromkeys(ONE_THREAD, "1")
    # What a trial step of a fit runs into is not for the user of the parent.
    warnings.simplefilter("ignore", RuntimeWarning)
    with contextlib.suppress(EOFError, OSError):
        while True:
            function, arguments = pipe.recv()
            pipe.send(_work(function, arguments, _reporter(pipe)))


def _end_with_parent(name: str) -> None:
    """Let the kernel end this process when the parent ends, also in the middle of a call; and name the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent ends the child
    with contextlib.suppress(OSError, AttributeError):  # on other systems the closed pipe ends it after the call
        library = ctypes.CDLL(None)
        library.prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
        library.prctl(_SET_NAME, name.encode())


def _yield_processor() -> None:
    """Yield the processor to control loops.

    Linux shares it between sessions first, and niceness counts only within one: hence a session of its own,
    and a nice group as well.
    """
    with contextlib.suppress(OSError, AttributeError):
        os.setsid()
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # a parent with real-time priority
    with contextlib.suppress(OSError, AttributeError):
        os.nice(NICENESS)
    with contextlib.suppress(OSError):
        Path("/proc/self/autogroup").write_text(str(NICENESS), encoding="ascii")


def _work(function: Callable[..., Any], arguments: tuple[Any, ...], report: Report) -> tuple[str, Any]:
    try:
        return "result", function(*arguments, report)
    except InputError as error:
        return "bad input", _one_line(error)
    except IdloopError as error:
        return "error", _one_line(error)
    except (EOFError, BrokenPipeError):
        raise  # the parent has ended
    except Exception as error:  # noqa: BLE001  (the parent must outlive any error of a computation)
        if os.environ.get("IDLOOP_DEBUG"):
            traceback.print_exc()
        return "error", f"{type(error).__name__}: {_one_line(error)}"


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _reporter(pipe: Connection) -> Report:
    last = 0.0

    def report(share: float, text: str = "") -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= REPORT_PERIOD:
            last = now
            pipe.send(("report", (float(share), str(text))))

    return report
