"""How soon an arm rests when the bridge, its guardian or both die or hang, on a live graph with the MuJoCo arm.

Time is counted from the fault to the first instant at which the set-point rests, by the steady clock.

    source launch_scripts/_environment; idloop_environment test
    .venv/bin/python benchmarks/arm_faults.py --faults 10
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "ros"))

from arm_graph import ACCELERATION, HORIZON, STOP_TIME, ArmGraph
from rich.console import Console
from rich.progress import track


def _guardian_killed(graph: ArmGraph) -> float:
    passed = graph.until_rest_after(graph.signal("guardian", signal.SIGKILL))
    graph.start("guardian")
    return passed


def _bridge_hangs(graph: ArmGraph) -> float:
    passed = graph.until_rest_after(graph.signal("trajectory_bridge", signal.SIGSTOP))
    graph.signal("trajectory_bridge", signal.SIGCONT)
    return passed


def _bridge_killed(graph: ArmGraph) -> float:
    passed = graph.until_rest_after(graph.signal("trajectory_bridge", signal.SIGKILL))
    graph.start("trajectory_bridge")
    return passed


def _both_killed(graph: ArmGraph) -> float:
    graph.signal("guardian", signal.SIGKILL)
    passed = graph.until_rest_after(graph.signal("trajectory_bridge", signal.SIGKILL))
    graph.start("trajectory_bridge")
    graph.start("guardian")
    return passed


FAULTS: dict[str, Callable[[ArmGraph], float]] = {
    "guardian killed with -9": _guardian_killed,
    "bridge hangs": _bridge_hangs,
    "bridge killed with -9": _bridge_killed,
    "both killed with -9": _both_killed,
}


def main() -> None:
    """Measure every fault so many times."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--faults", type=int, default=10, help="of each kind")
    given = parser.parse_args()
    out = Console()
    with tempfile.TemporaryDirectory() as folder:
        graph = ArmGraph(Path(folder), approach=2.0)
        found: dict[str, list[float]] = {name: [] for name in FAULTS}
        largest = 0.0
        try:
            for _ in track(range(given.faults), "faults", console=Console(stderr=True)):
                for name, cause in FAULTS.items():
                    graph.until_moving()
                    found[name].append(cause(graph))
                    largest = max(largest, graph.largest_acceleration())
        finally:
            graph.stop()
    for name, times in found.items():
        out.print(f"{name:26} {len(times):3}  median {median(times):.3f} s  largest {max(times):.3f} s")
    out.print(
        f"stop_time {STOP_TIME:g} s, horizon {HORIZON:g} s; "
        f"largest acceleration {largest:.3g} of {ACCELERATION:g} rad/s²"
    )


if __name__ == "__main__":
    main()
