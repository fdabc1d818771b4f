"""How the operating system schedules a node's process."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Literal

Scheduling = Literal["normal", "batch", "preferred"]

THREADS = Path("/proc/self/task")
GROUP = Path("/proc/self/autogroup")
PREFERENCE = -10  # niceness: ten times the share of an ordinary process where there is not enough for all, never all


def use_scheduling(kind: Scheduling) -> None:
    """Schedule the threads of this process, and those they start."""
    if kind == "batch":
        use_batch_scheduling()
    elif kind == "preferred":
        raise_share()


def use_batch_scheduling() -> None:
    """Let the threads of this process, and those they start, wake up without pushing another aside.

    For listeners that may lag behind. A message wakes a thread; where that one at once takes the place of the sender,
    each message costs two changes of threads, and the next finds it asleep again. Where it waits, several messages
    wake it once.
    """
    if hasattr(os, "SCHED_BATCH"):
        _for_all_threads(lambda thread: os.sched_setscheduler(thread, os.SCHED_BATCH, os.sched_param(0)))


def raise_share() -> None:
    """Ask for a larger share for the threads of this process, and those they start.

    For listeners that must keep up with the clock on a machine that others use as well. Unlike a real-time schedule
    it takes nothing from a loop with deadlines and never keeps a service from being answered.
    """
    if hasattr(os, "setpriority"):
        _for_all_threads(lambda thread: os.setpriority(os.PRIO_PROCESS, thread, PREFERENCE))
        # Linux shares out by session first, and niceness counts only within one; another's session is not ours to move.
        if GROUP.is_file() and os.getsid(0) == os.getpid():
            with contextlib.suppress(OSError):
                GROUP.write_text(str(PREFERENCE), encoding="ascii")


def _for_all_threads(ask: Callable[[int], None]) -> None:
    if not THREADS.is_dir():
        return
    for thread in THREADS.iterdir():
        try:
            ask(int(thread.name))
        except OSError:  # a thread that has ended meanwhile, or a system that forbids it: it only costs time
            continue
