"""The process that computes: what it returns, what it says on the way, and how it is lost."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from idloop.errors import IdloopError, InputError
from idloop.worker_process import WorkerProcess


@pytest.fixture(scope="module")
def worker():
    one = WorkerProcess()
    yield one
    one.close()


def test_it_works_elsewhere_and_reports(worker):
    said = []
    here = os.getpid()
    there = worker.call(_where, "half", report=lambda share, text: said.append((share, text)))
    assert there != here
    assert said == [(0.5, "half")]


@pytest.mark.parametrize(
    ("error", "kind", "line"),
    [
        ("InputError", InputError, "bad\n news"),
        ("IdloopError", IdloopError, "bad\n news"),
        ("ZeroDivisionError", IdloopError, "bad\n news"),
    ],
)
def test_what_goes_wrong_is_one_line(worker, error, kind, line):
    with pytest.raises(kind, match=r"bad news$"):
        worker.call(_fail, error, line)


def test_a_lost_process_is_said_and_started_anew(worker):
    with pytest.raises(IdloopError, match="ended in the middle"):
        worker.call(_die)
    assert worker.call(_where, "again") != os.getpid()


@pytest.mark.parametrize("at", ["sent", "begun"])
def test_it_can_be_closed_in_the_middle_and_then_stays_closed(at):
    worker, begun, ended = WorkerProcess(), threading.Event(), []

    def call():
        with pytest.raises(IdloopError, match="ended in the middle") as caught:
            worker.call(_stay, report=lambda share, text: begun.set())
        ended.append(caught)

    caller = threading.Thread(target=call)
    caller.start()
    if at == "begun":
        assert begun.wait(200.0)
    else:
        while worker._process is None:
            begun.wait(0.001)
    worker.close()
    caller.join(200.0)
    assert ended
    with pytest.raises(IdloopError, match="has been ended"):
        worker.call(_where, "late")


def _stay(report):
    report(0.0, "")
    threading.Event().wait()


def _where(text, report):
    report(0.5, text)
    return os.getpid()


def _fail(name, text, report):
    import builtins

    import idloop.errors

    raise (getattr(idloop.errors, name, None) or getattr(builtins, name))(text)


def _die(report):
    os.kill(os.getpid(), signal.SIGKILL)
