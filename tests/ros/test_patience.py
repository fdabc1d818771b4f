"""Threads that are there wait their turn, and so do those that come after."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

SCRIPT = """
import os, threading
from idloop_nodes.patience import become_patient
asked, told = threading.Event(), []
def early():
    asked.wait()
    told.append(os.sched_getscheduler(0))
def late():
    told.append(os.sched_getscheduler(0))
threads = [threading.Thread(target=early), threading.Thread(target=late)]
threads[0].start()
become_patient()
asked.set()
threads[1].start()
for thread in threads:
    thread.join()
print(*told, os.sched_getscheduler(0))
"""


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="only Linux has such a schedule")
def test_every_thread_becomes_patient():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True, timeout=200)
    assert done.stdout.split() == [str(os.SCHED_BATCH)] * 3


def test_a_system_that_forbids_it_changes_nothing(monkeypatch):
    from idloop_nodes import patience

    def forbid(*arguments):
        raise PermissionError

    monkeypatch.setattr(patience.os, "sched_setscheduler", forbid, raising=False)
    patience.become_patient()
