"""The estimator's worker process: does one job after the other, out of the loop's way."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path
from typing import IO, Any

from idloop.errors import IdloopError
from idloop_nodes.estimation.worker import Job, Note, Report, receive, send

PR_SET_PDEATHSIG = 1
NICENESS = 10  # a job may take longer; the loop may not
NOTE_PERIOD = 0.2  # seconds between two notes on how far a job is


def work(job: Job, report: Report) -> Any:
    """Do one job; whatever goes wrong becomes the answer's error line."""
    try:
        return job.work(report)
    except IdloopError as error:
        text = str(error)
    except Exception as error:  # noqa: BLE001  (a job must never end the live estimator)
        if os.environ.get("IDLOOP_DEBUG"):
            traceback.print_exc()
        text = f"{type(error).__name__}: {error}"
    return job.failed(" ".join(text.split()))


def reporter(stream: IO[bytes], number: int) -> Report:
    """Return a function that sends notes, not too many of them."""
    last = 0.0

    def report(share: float, text: str = "") -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= NOTE_PERIOD:
            last = now
            send(stream, Note(number, float(share), text))

    return report


def die_with_parent() -> None:
    """Let the kernel end this process when the estimator goes, however it goes: a job may be in full swing."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError, AttributeError):  # other systems: the closed pipe ends it after the job
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def step_back() -> None:
    """Yield the processor to the loop.

    Linux shares it out by session first, and niceness counts only within one: hence a session of its own,
    and its group made nice too.
    """
    with contextlib.suppress(OSError, AttributeError):
        os.setsid()
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # a graph started with real-time priority
    os.nice(NICENESS)
    with contextlib.suppress(OSError):
        Path("/proc/self/autogroup").write_text(str(NICENESS), encoding="ascii")


def main() -> None:
    """Serve jobs from stdin until it closes."""
    die_with_parent()
    step_back()
    # What a trial step of a fit runs into is not for the log of a live graph.
    warnings.simplefilter("ignore", RuntimeWarning)
    jobs, answers = sys.stdin.buffer, os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    # Anything a library prints must not get between the pickles.
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    while (job := receive(jobs)) is not None:
        send(answers, work(job, reporter(answers, job.number)))


if __name__ == "__main__":
    main()
