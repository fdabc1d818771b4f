"""Threads that are there wait their turn, and so do those that come after."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes import scheduling as patience

SCRIPT = """
import os, sys, threading
from idloop_nodes import scheduling as patience
ask = {ask}
asked, told = threading.Event(), []
def early():
    asked.wait()
    told.append({tell})
def late():
    told.append({tell})
threads = [threading.Thread(target=early), threading.Thread(target=late)]
threads[0].start()
ask()
asked.set()
threads[1].start()
for thread in threads:
    thread.join()
print(*told, {tell})
"""


def told(ask, tell):
    script = SCRIPT.format(ask=f"patience.{ask}", tell=tell)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=200)
    return done.stdout.split()


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="only Linux has such a schedule")
def test_every_thread_becomes_patient():
    assert told("become_patient", "os.sched_getscheduler(0)") == [str(os.SCHED_BATCH)] * 3


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="only Linux tells threads apart")
def test_every_thread_becomes_preferred_where_that_is_allowed():
    before = os.getpriority(os.PRIO_PROCESS, 0)
    allowed = os.geteuid() == 0
    wanted = patience.PREFERENCE if allowed else before
    assert told("become_preferred", "os.getpriority(os.PRIO_PROCESS, threading.get_native_id())") == [str(wanted)] * 3


@pytest.mark.parametrize("ask", ["become_patient", "become_preferred"])
def test_a_system_that_forbids_it_changes_nothing(monkeypatch, ask):
    def forbid(*arguments):
        raise PermissionError

    for name in ("sched_setscheduler", "setpriority"):
        monkeypatch.setattr(patience.os, name, forbid, raising=False)
    getattr(patience, ask)()
