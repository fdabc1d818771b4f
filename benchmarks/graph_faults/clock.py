"""The wall clock of the whole machine set by an hour, for the processes of one graph.

A small library of ours (`clock_shim.c`) stands between them and the clock of the system, which stays as it is for
everybody else. All of them see the step at the same instant; the steady clock is left alone, as the system leaves it.
"""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import struct
import subprocess
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from faults import Fault, at_random
from live import LiveGraph
from outcome import Outcome

SOURCE = Path(__file__).with_name("clock_shim.c")


def left_out() -> str:
    """What is not counted here, and why."""
    return "" if shutil.which("cc") else "the clock of the whole graph is not set: there is no C compiler"


@contextlib.contextmanager
def steerable(folder: Path) -> Iterator[dict[str, Fault]]:
    """Let processes that start within see a clock that the faults set."""
    offset, shim = folder / "offset", folder / "clock_shim.so"
    offset.write_bytes(struct.pack("q", 0))
    subprocess.run([shutil.which("cc") or "cc", "-shared", "-fPIC", "-O2", "-o", shim, SOURCE, "-ldl"], check=True)
    variables = {"LD_PRELOAD": str(shim), "IDLOOP_CLOCK_OFFSET": str(offset)}
    before = {name: os.environ.get(name) for name in variables}
    os.environ |= variables
    try:
        yield {
            "system clock set an hour ahead": partial(_set, offset, 3600),
            "system clock set an hour back": partial(_set, offset, -3600),
        }
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def _set(offset: Path, step: int, graph: LiveGraph, chance: random.Random) -> Outcome:
    at_random(graph, chance)
    with offset.open("r+b") as file:
        (now,) = struct.unpack("q", file.read())
        file.seek(0)
        since = time.monotonic_ns()
        file.write(struct.pack("q", now + step * 10**9))
    found = Outcome()
    found.told_zero(graph.until_zero_after(since, count=1))
    started = time.monotonic()
    graph.until_alive()
    found.back = time.monotonic() - started
    return found
