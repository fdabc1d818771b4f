"""A process that computes while the page stays alive: one piece of work after the other."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from idloop.errors import IdloopError, InputError

NICENESS = 10  # the work may take longer; a control loop on the same machine may not
REPORT_PERIOD = 0.1  # seconds between two reports

Report = Callable[[float, str], None]


class Worker:
    """One child process, started with the first piece of work and anew after it was lost.

    Functions and their arguments travel as pickles. Any thread may close it for good, also in the middle of a piece.
    """

    def __init__(self) -> None:
        self._calling = threading.Lock()  # who holds it alone uses the pipe
        self._changing = threading.Lock()
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None
        self._closed = False

    def call(self, function: Callable[..., Any], *arguments: Any, report: Report = lambda share, text: None) -> Any:
        """Run ``function(*arguments, report)`` in the child and return what it returns.

        Raises
        ------
        InputError, IdloopError
            As the function did, or because the child was lost or closed.
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
                raise IdloopError("the process that computes was ended in the middle of it") from error

    def _ready(self) -> Connection:
        if self._pipe is not None and self._process is not None and self._process.is_alive():
            return self._pipe
        self._lose()
        with self._changing:
            if self._closed:
                raise IdloopError("the process that computes has been ended")
            # A fresh interpreter: a copy of this one would hold its sockets and half of its threads.
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(target=serve, args=(theirs,), name="idloop workbench", daemon=True)
            self._process.start()
            theirs.close()
            return self._pipe

    def _lose(self) -> None:
        """Leave nothing of a child behind; only for whoever holds the right to call."""
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
                self._process.kill()  # whoever waits for it now finds its end of the pipe closed
        with self._calling:
            self._lose()


def serve(pipe: Connection) -> None:
    """Work until the other side is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent ends us
    with contextlib.suppress(OSError, AttributeError):
        os.nice(NICENESS)
    # What a trial step of a fit runs into is not for the reader of the page.
    warnings.simplefilter("ignore", RuntimeWarning)
    with contextlib.suppress(EOFError, OSError):
        while True:
            function, arguments = pipe.recv()
            pipe.send(_work(function, arguments, _reporter(pipe)))


def _work(function: Callable[..., Any], arguments: tuple[Any, ...], report: Report) -> tuple[str, Any]:
    try:
        return "result", function(*arguments, report)
    except InputError as error:
        return "bad input", _one_line(error)
    except IdloopError as error:
        return "error", _one_line(error)
    except (EOFError, OSError):
        raise  # the page has gone
    except Exception as error:  # noqa: BLE001  (the page must outlive whatever a computation meets)
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
