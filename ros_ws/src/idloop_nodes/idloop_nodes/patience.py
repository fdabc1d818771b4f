"""A process that lets others finish before it takes its turn."""

from __future__ import annotations

import os
from pathlib import Path

THREADS = Path("/proc/self/task")


def become_patient() -> None:
    """Let the threads of this process, and those they start, wake up without pushing another aside.

    For listeners that may lag behind. A message wakes a thread; where that one at once takes the place of the sender,
    each message costs two changes of threads, and the next finds it asleep again. Where it waits, several messages
    wake it once.
    """
    if not hasattr(os, "SCHED_BATCH") or not THREADS.is_dir():
        return
    for thread in THREADS.iterdir():
        try:
            os.sched_setscheduler(int(thread.name), os.SCHED_BATCH, os.sched_param(0))
        except OSError:  # a thread that has ended meanwhile, or a system that forbids it: it only costs time
            continue
