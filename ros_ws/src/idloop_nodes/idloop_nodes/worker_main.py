"""The estimator's worker process: fits a window, judges the fit on the samples after it."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from idloop.errors import IdloopError
from idloop_nodes.codec import FitSummary, ParameterSummary
from idloop_nodes.fit_jobs import FitAnswer, FitJob, receive, send

if TYPE_CHECKING:
    from idloop.physics import Model

PR_SET_PDEATHSIG = 1
NICENESS = 10  # a fit may take longer; the loop may not


def work(job: FitJob) -> FitAnswer:
    """Do one job; whatever goes wrong becomes the answer's error line."""
    try:
        return _fit(job)
    except IdloopError as error:
        text = str(error)
    except Exception as error:  # noqa: BLE001  (a fit must never end the live estimator)
        text = f"{type(error).__name__}: {error}"
    summary = FitSummary(
        job.model.name,
        tuple(job.model.effect_names),
        job.criterion,
        job.fit_window,
        job.validation_window,
        error=" ".join(text.split()),
    )
    return FitAnswer(job.number, summary, ())


def _fit(job: FitJob) -> FitAnswer:
    from idloop.estimate import fit
    from idloop.validate import compare

    result = fit(job.model, [job.fit_record], criterion=job.criterion)
    unseen, seen = (compare(result.model, record) for record in (job.validation_record, job.fit_record))
    summary = FitSummary(
        job.model.name,
        tuple(job.model.effect_names),
        result.criterion,
        job.fit_window,
        job.validation_window,
        fit=dict(unseen.fit),
        fit_train=dict(seen.fit),
        loss=result.loss,
    )
    return FitAnswer(job.number, summary, summarise(result.model))


def summarise(model: Model) -> tuple[ParameterSummary, ...]:
    """Return the model's estimated parameters."""
    return tuple(
        ParameterSummary(one.name, one.value, one.stderr, one.unit, one.min, one.max, one.free)
        for one in model.parameters
        if one.free
    )


def die_with_parent() -> None:
    """Let the kernel end this process when the estimator goes, however it goes: a fit may be in full swing."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError, AttributeError):  # other systems: the closed pipe ends it after the fit
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
        send(answers, work(job))


if __name__ == "__main__":
    main()
