"""Jobs for the worker process: answers, replaced jobs, and what happens when the process dies."""

from __future__ import annotations

import os
import signal
import threading
import time

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.estimation.diagnosis_jobs import DIAGNOSE, UNDO, DiagnosisOrder
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


class Office:
    """Submits orders to a queue and keeps their answers."""

    def __init__(self, worker):
        self.worker, self.answers = worker, []

    def order(self, verb=UNDO, *, replaceable=False, **more):
        from idloop.physics import load_model

        one = DiagnosisOrder("estimator", verb, 0, load_model("dc_motor"), **more)
        self.worker.submit(
            one.carry_out,
            self.answers.append,
            lambda reason: self.answers.append(one.failed(reason)),
            replaceable=replaceable,
        )
        return one

    def results(self, count):
        pause, end = threading.Event(), time.monotonic() + WAIT
        while len(self.answers) < count:
            assert time.monotonic() < end, self.answers
            self.worker.deliver()
            pause.wait(0.01)
        found, self.answers = self.answers, []
        return found


def pid(queue):
    """Number of the worker process, once it has started."""
    pause, end = threading.Event(), time.monotonic() + WAIT
    while queue.pid is None:
        assert time.monotonic() < end
        pause.wait(0.01)
    return queue.pid


def test_what_goes_wrong_in_the_worker_is_a_line_in_the_answer(worker):
    one = worker()
    office = Office(one)
    office.order()
    office.order(DIAGNOSE)
    assert one.busy
    first, second = office.results(2)
    assert not one.busy
    assert (first.verb, first.error) == (UNDO, "there is no step to take back")
    assert second.missing.error == second.error
    assert "\n" not in second.error


@pytest.mark.slow
def test_a_worker_that_dies_is_replaced(worker):
    one = worker()
    office = Office(one)
    office.order()
    office.results(1)
    first = pid(one)
    os.kill(first, signal.SIGSTOP)  # so that the next job is certainly under way
    office.order(state=b"kept")
    os.kill(first, signal.SIGKILL)
    (answer,) = office.results(1)
    assert "ended in the middle" in answer.error
    assert answer.state == b"kept"
    assert one.failures == 1
    office.order()
    assert office.results(1)[0].error == "there is no step to take back"
    assert pid(one) != first


def test_a_newer_window_replaces_one_that_waits_but_never_an_order(worker):
    one = worker()
    office = Office(one)
    os.kill(pid(one), signal.SIGSTOP)
    office.order()
    office.order(replaceable=True)
    office.order(replaceable=True)
    kept, newest = office.order(), office.order(replaceable=True)
    assert [job.work for job in one._waiting] == [kept.carry_out, newest.carry_out]
    assert (one.submitted, one.skipped) == (5, 2)
    both = worker(keep_all=True)
    os.kill(pid(both), signal.SIGSTOP)
    office = Office(both)
    orders = [office.order(replaceable=True) for _ in range(3)]
    assert [job.work for job in both._waiting] == [order.carry_out for order in orders[1:]]
