"""Jobs for the worker process: answers, replaced jobs, and what happens when the process dies."""

from __future__ import annotations

import os
import signal
import threading
import time
from dataclasses import dataclass

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.estimation.diagnosis_jobs import DIAGNOSE, UNDO, DiagnosisJob
from idloop_nodes.estimation.job_queue import JobQueue

WAIT = 200.0


@pytest.fixture
def worker():
    made = []

    def build(**more):
        made.append(JobQueue(**{"keep_all": False} | more))
        return made[-1]

    yield build
    for one in made:
        one.close()


def results(worker, count):
    found, pause, end = [], threading.Event(), time.monotonic() + WAIT
    while len(found) < count:
        assert time.monotonic() < end, found
        found += worker.answers()
        pause.wait(0.01)
    return found


def pid(queue):
    """Number of the worker process, once it has started."""
    pause, end = threading.Event(), time.monotonic() + WAIT
    while queue.pid is None:
        assert time.monotonic() < end
        pause.wait(0.01)
    return queue.pid


def order(number, verb=UNDO, **more):
    from idloop.physics import load_model

    return DiagnosisJob(number, verb, 0, load_model("dc_motor"), **more)


def test_what_goes_wrong_in_the_worker_is_a_line_in_the_answer(worker):
    one = worker()
    one.submit(order(1))
    one.submit(order(2, DIAGNOSE))
    assert one.busy
    first, second = results(one, 2)
    assert not one.busy
    assert (first.number, first.error) == (1, "there is no step to take back")
    assert second.missing.error == second.error
    assert "\n" not in second.error


@pytest.mark.slow
def test_a_worker_that_dies_is_replaced(worker):
    one = worker()
    one.submit(order(1))
    results(one, 1)
    first = pid(one)
    os.kill(first, signal.SIGSTOP)  # so that the next job is certainly under way
    one.submit(order(2, state=b"kept"))
    os.kill(first, signal.SIGKILL)
    (answer,) = results(one, 1)
    assert "ended in the middle" in answer.error
    assert answer.state == b"kept"
    assert one.failures == 1
    one.submit(order(3))
    assert results(one, 1)[0].number == 3
    assert pid(one) != first


@dataclass(frozen=True)
class Small:
    """A job that only this test knows: it is never sent."""

    number: int
    replaceable: bool = True


def test_a_newer_window_replaces_one_that_waits_but_never_an_order(worker):
    one = worker()
    os.kill(pid(one), signal.SIGSTOP)
    one.submit(order(1))
    for number in (2, 3):
        one.submit(Small(number))
    one.submit(order(4))
    one.submit(Small(5))
    assert [job.number for job in one._waiting] == [4, 5]
    assert one.skipped == 2
    both = worker(keep_all=True)
    os.kill(pid(both), signal.SIGSTOP)
    for number in (1, 2, 3):
        both.submit(order(number))
    assert [job.number for job in both._waiting] == [2, 3]
