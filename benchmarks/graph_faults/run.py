"""A fault campaign on the whole live graph: nothing recorded is lost, the motor is told zero, the graph goes on.

Every round starts a graph and puts it through each kind of fault once, in an order and at times that the seed decides.
What is counted, and what is held against a fault:

- the time from the last command that was none to the first zero, by the robot's own steady clock: 50 ms at most,
- what a recording that was cut off has lost of what the robot had measured: the last chunk at most; and no measurement
  is missing within any recording, unless what brings it was itself down,
- afterwards the motor is driven, samples are predicted and the recording grows; or a node says in one line why not,
- no zombies, no process left behind.

    source launch_scripts/_environment; idloop_environment test
    .venv/bin/python benchmarks/graph_faults/run.py --rounds 6
    .venv/bin/python benchmarks/graph_faults/run.py --rounds 2 --only clock simulated packets
    .venv/bin/python benchmarks/graph_faults/run.py --soak 3600
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent / "tests" / "ros"))

import clock
import packets
import robot_graph
import simulated
import soak
from faults import FAULTS, Fault
from leftovers import leftovers
from live import LiveGraph, environment
from outcome import Outcome

robot_graph.PATIENCE = 120.0  # a graph that is not back by then does not come back
GONE = 15.0  # seconds that a process which has lost its parent has to end

Found = dict[str, list[Outcome]]


def remains(graph: LiveGraph) -> list[str]:
    """What is still there of processes that should be gone."""
    end = time.monotonic() + GONE
    while found := leftovers(str(graph.folder), [one.pid for one in graph.processes.values()]):
        if time.monotonic() > end:
            return found
        threading.Event().wait(0.1)
    return []


def live_round(folder: Path, faults: Mapping[str, Fault], chance: random.Random, found: Found,
               prefixes: Mapping[str, Sequence[str]] | None = None) -> None:  # fmt: skip
    """Put one graph through every fault."""
    graph = LiveGraph(folder, prefixes)
    order = chance.sample(sorted(faults), len(faults))
    try:
        graph.until_alive()
        for name in order:
            outcome = faults[name](graph, chance)
            outcome.wrong += remains(graph)
            found.setdefault(name, []).append(outcome)
            say(name, outcome)
        last = Outcome()
        graph.end_recorder(last)
        found.setdefault("(the recording at the end)", []).append(last)
        say("(the recording at the end)", last)
    except Exception as error:  # noqa: BLE001 (a graph that does not come back is a finding, the next round goes on)
        traceback.print_exc()
        lost = Outcome(wrong=[f"the graph did not come back: {type(error).__name__} {str(error)[:600]}"])
        found.setdefault("(a round that broke off)", []).append(lost)
        say("(a round that broke off)", lost)
    finally:
        graph.stop()


def say(name: str, outcome: Outcome) -> None:
    """One line on the way."""
    numbers = [
        f"{what} {1e3 * value:.0f} ms"
        for what, value in (("zero", outcome.zero), ("tail", outcome.tail), ("back", outcome.back))
        if value is not None
    ]
    print(f"  {name}: {', '.join(numbers)} {'; '.join(outcome.wrong + outcome.late)}", file=sys.stderr, flush=True)


def table(found: Found) -> int:
    """Print the counts; return the number of faults after which something was wrong."""
    print(f"{'fault':44} {'count':>5} {'zero, largest':>14} {'lost, largest':>14} {'back, median':>13}  wrong")
    for name in sorted(found):
        outcomes = found[name]
        print(
            f"{name:44} {len(outcomes):5}"
            f" {_told(max, (one.zero for one in outcomes), 1e3, 'ms'):>14}"
            f" {_told(max, (one.tail for one in outcomes), 1e3, 'ms'):>14}"
            f" {_told(median, (one.back for one in outcomes), 1.0, 's'):>13}"
            f"  {sum(bool(one.wrong or one.late) for one in outcomes)}"
        )
        for one in outcomes:
            for text in one.wrong + one.late:
                print(f"{'':6}{text}")
    everything = [one for outcomes in found.values() for one in outcomes]
    wrong = sum(bool(one.wrong or one.late) for one in everything)
    counted = sum(len(outcomes) for name, outcomes in found.items() if not name.startswith("("))
    print(f"{counted} faults, {wrong} with findings")
    return wrong


def _told(how, values: Iterable[float | None], scale: float, unit: str) -> str:  # noqa: ANN001
    known = [value for value in values if value is not None]
    return f"{scale * how(known):.1f} {unit}" if known else ""


SECTIONS = ("live", "clock", "simulated", "packets")


def main() -> int:
    """Run the campaign from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=6, help="of every kind of fault (default 6)")
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=SECTIONS, help="some kinds; all when left out")
    parser.add_argument("--fault", nargs="+", default=("",), help="faults on the live graph whose name begins so")
    parser.add_argument("--seed", type=int, default=0, help="of order and times (default 0)")
    parser.add_argument("--domain", type=int, default=97, help="ROS domain of the graph (default 97)")
    parser.add_argument("--soak", type=float, metavar="SECONDS", help="run the graph at 1 kHz and watch its memory")
    arguments = parser.parse_args()
    found: Found = {}
    with tempfile.TemporaryDirectory(prefix="idloop_faults_") as name:
        folder = Path(name)
        environment(folder, arguments.domain)
        if arguments.soak:
            return soak.run(folder, arguments.soak)
        # Packets last: a process that has once spoken to another network is deaf on its own afterwards.
        for section, number in product((one for one in SECTIONS if one in arguments.only), range(arguments.rounds)):
            chance = random.Random(f"{arguments.seed} {number}")  # noqa: S311 (faults, no secrets)
            own = folder / f"{section}_{number}"
            own.mkdir()
            print(f"{section}, round {number + 1}", file=sys.stderr)
            if section == "live":
                wanted = {one: fault for one, fault in FAULTS.items() if one.startswith(tuple(arguments.fault))}
                live_round(own, wanted, chance, found)
            elif section == "clock" and not clock.left_out():
                with clock.steerable(own) as faults:
                    live_round(own, faults, chance, found)
            elif section == "simulated":
                simulated.round_of(own, chance, found, say)
            elif section == "packets":
                packets.round_of(own, chance, found, live_round)
        for said in (clock.left_out(), packets.left_out()):
            if said:
                print(said)
        return int(table(found) > 0)


if __name__ == "__main__":
    sys.exit(main())
