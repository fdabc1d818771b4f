"""The schedule of a process: of its threads, and of those that they start."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes import timing

SCRIPT = """
import os, sys, threading
from idloop_nodes import timing
ask = {ask}
asked, found = threading.Event(), []
def early():
    asked.wait()
    found.append({tell})
def late():
    found.append({tell})
threads = [threading.Thread(target=early), threading.Thread(target=late)]
threads[0].start()
ask()
asked.set()
threads[1].start()
for thread in threads:
    thread.join()
print(*found, {tell})
"""


def answers(ask, tell):
    script = SCRIPT.format(ask=f"timing.{ask}", tell=tell)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=200)
    return done.stdout.split()


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="only Linux has such a schedule")
def test_every_thread_is_scheduled_in_batches():
    assert answers("use_batch_scheduling", "os.sched_getscheduler(0)") == [str(os.SCHED_BATCH)] * 3


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="only Linux tells threads apart")
def test_every_thread_gets_a_larger_share_where_that_is_allowed():
    before = os.getpriority(os.PRIO_PROCESS, 0)
    allowed = os.geteuid() == 0
    wanted = timing.PREFERENCE if allowed else before
    assert answers("raise_share", "os.getpriority(os.PRIO_PROCESS, threading.get_native_id())") == [str(wanted)] * 3


@pytest.mark.parametrize("ask", ["use_batch_scheduling", "raise_share"])
def test_a_system_that_forbids_it_changes_nothing(monkeypatch, ask):
    def forbid(*arguments):
        raise PermissionError

    for name in ("sched_setscheduler", "setpriority"):
        monkeypatch.setattr(timing.os, name, forbid, raising=False)
    getattr(timing, ask)()
