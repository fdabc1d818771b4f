"""How soon a robot is told zero when a peer of the bridge dies, hangs or lies.

A robot, the excitation, the controller and the bridge run as processes in real time. Time is counted from the last
good command to the first zero, by the robot's own steady clock; beside it, how late this machine wakes an urgent
sleeper, for no node can be better than that.

    source launch_scripts/_environment; idloop_environment test
    .venv/bin/python benchmarks/bridge_faults.py --faults 20 --load 2
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "ros"))

from rich.console import Console
from rich.progress import track
from robot_graph import RobotGraph

from idloop_nodes.timing import become_urgent

_WANTED = 0.05
_SLEEP = 0.002


class Sleeper(threading.Thread):
    """Sleeps for two milliseconds at a time, with the bridge's urgency; keeps how late it woke [s]."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.late: list[float] = []

    def run(self) -> None:
        """Sleep, again and again."""
        become_urgent(40)
        while True:
            begun = time.perf_counter()
            time.sleep(_SLEEP)
            self.late.append(time.perf_counter() - begun - _SLEEP)


def _killed(graph: RobotGraph) -> float:
    passed = graph.until_zero_after(graph.signal("controller", signal.SIGKILL))
    graph.processes["controller"].wait()
    graph.start("controller")
    return passed


def _hung(name: str) -> Callable[[RobotGraph], float]:
    def fault(graph: RobotGraph) -> float:
        passed = graph.until_zero_after(graph.signal(name, signal.SIGSTOP))
        graph.signal(name, signal.SIGCONT)
        return passed

    return fault


def _ordered(*words: object) -> Callable[[RobotGraph], float]:
    def fault(graph: RobotGraph) -> float:
        passed = graph.until_zero_after(graph.order(*words), count=1)
        graph.order("good")
        return passed

    return fault


FAULTS: dict[str, Callable[[RobotGraph], float]] = {
    "controller killed": _killed,
    "controller hung": _hung("controller"),
    "excitation hung": _hung("excitation"),
    "robot silent": _ordered("quiet"),
    "robot's clock an hour behind": _ordered("jump", -3600),
}


@contextmanager
def _loaded(count: int) -> Iterator[None]:
    """So many processes that do nothing but compute."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for one in busy:
            one.kill()
            one.wait()


def main() -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faults", type=int, default=20, help="of each kind (default 20)")
    parser.add_argument("--load", type=int, default=0, help="busy processes beside the graph (default none)")
    parser.add_argument("--domain", type=int, default=98, help="ROS domain of the graph (default 98)")
    arguments = parser.parse_args()
    os.environ |= {"ROS_DOMAIN_ID": str(arguments.domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    found: dict[str, list[float]] = {}
    sleeper = Sleeper()
    screen = Console(stderr=True)
    with tempfile.TemporaryDirectory() as folder, _loaded(arguments.load):
        for name, fault in FAULTS.items():
            own = Path(folder, name)
            own.mkdir()
            graph = RobotGraph(own, {})
            try:
                graph.until_driven()
                if not sleeper.is_alive():
                    sleeper.start()
                for _ in track(range(arguments.faults), name, console=screen, disable=not screen.is_terminal):
                    found.setdefault(name, []).append(fault(graph))
                    graph.until_driven()
            finally:
                graph.stop()
    print(f"{'fault':30} {'count':>6} {'median':>8} {'largest':>8}  above {1e3 * _WANTED:.0f} ms")
    for name, seconds in found.items():
        above = sum(one > _WANTED for one in seconds)
        print(f"{name:30} {len(seconds):6} {1e3 * median(seconds):5.1f} ms {1e3 * max(seconds):5.1f} ms  {above}")
    late = sleeper.late
    print(f"{'an urgent sleeper was late':30} {len(late):6} {1e3 * median(late):5.1f} ms {1e3 * max(late):5.1f} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
