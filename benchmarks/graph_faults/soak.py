"""The simulated graph at 1 kHz in real time for as long as wanted, and how much memory each node holds over time."""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path

import numpy as np
from leftovers import leftovers, memory

from idloop.errors import IdloopError
from idloop.graph import GraphRun, load_graph
from idloop.records import read_streams

LOOKS = 60  # in the whole run
SETTLED = 0.25  # share of the run after which windows and queues are as long as they get
GROWTH = 20.0  # growth from then to the end that is no growth: noise of an allocator [MB]
SHORTEST = 600.0  # a shorter run is still filling its windows and queues, and is not judged by its memory [s]
START = 120.0  # longest time until the first sample [s]


def run(folder: Path, seconds: float, graph: str = "torsion") -> int:
    """Run it; return 1 when a node's memory grew or samples are missing."""
    bag = folder / "bag"
    lines: list[str] = []
    values = {"mode": "realtime", "duration": str(seconds), "bag": str(bag), "auto_diagnose": "false"}
    run_of_graph = GraphRun(load_graph(graph, values), say=lambda label, line: lines.append(f"{label}: {line}"))
    held: dict[str, list[float]] = {}
    times: list[float] = []
    try:
        end = time.monotonic() + START
        while not any("start: " in line for line in lines):
            if time.monotonic() > end:
                raise IdloopError(f"the graph did not start: {lines[-3:]}")
            threading.Event().wait(0.05)
        begun = time.monotonic()
        pids = {one.label: one.process.pid for one in run_of_graph._children}  # noqa: SLF001

        def look() -> bool:
            passed = time.monotonic() - begun
            if passed >= len(times) * seconds / LOOKS and passed < seconds:
                times.append(passed)
                for name, pid in pids.items():
                    held.setdefault(name, []).append(memory(pid))
                told = ", ".join(f"{name} {values[-1]:.0f}" for name, values in held.items())
                print(f"  {passed:6.0f} s: {told} MB", file=sys.stderr, flush=True)
            return False

        run_of_graph.wait(look)
    finally:
        run_of_graph.stop()
    wrong = [*leftovers(str(folder), []), *(line for line in lines if "Traceback" in line)]
    print(f"{'node':12} {'at the start':>13} {'settled':>9} {'at the end':>11} {'growth since':>13} [MB]")
    settled = np.searchsorted(times, SETTLED * seconds)
    for name, values in held.items():
        # The middle of a stretch: a fit that happens to run is no growth.
        early, late = np.median(values[settled : settled + 5]), np.median(values[-5:])
        print(f"{name:12} {values[0]:13.0f} {early:9.0f} {late:11.0f} {late - early:13.1f}")
        if late - early > GROWTH and seconds >= SHORTEST:
            wrong.append(f"{name} grew by {late - early:.0f} MB")
    stamps = read_streams(bag)["/joint_states"].stamp_ns
    steps = np.diff(stamps)
    missing = round(float((steps / np.median(steps) - 1).sum()))
    size = sum(file.stat().st_size for file in bag.glob("*.mcap")) / 1e6
    said = next((line for line in lines if "recorded" in line and "lost" in line), "the recorder said nothing")
    print(f"{len(stamps)} samples in {seconds:.0f} s, {missing} missing in the recording of {size:.0f} MB; {said}")
    for one in wrong:
        print(one)
    return int(bool(wrong) or "lost 0, dropped 0" not in said)
