"""The simulated graph under its launcher: a node that dies ends it in one line, one that hangs holds it up."""

from __future__ import annotations

import random
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

from leftovers import leftovers
from outcome import Outcome

from idloop.errors import IdloopError
from idloop.graph import GraphRun, load_graph
from idloop.records import read_streams
from idloop.records.bags.recover import recover_bag

NODES = ("excitation", "controller", "plant", "recorder", "estimator")
PATIENCE = 300.0
SAMPLES = 6000
VALUES = {"duration": "60.0", "window": "10.0", "validation": "5.0", "fit_period": "15.0", "auto_diagnose": "false"}


def round_of(folder: Path, chance: random.Random, found: dict[str, list[Outcome]],
             say: Callable[[str, Outcome], None]) -> None:  # fmt: skip
    """Kill and stop each node once, every time in a run of its own."""
    for number, name in enumerate(chance.sample(NODES, len(NODES))):
        for what, number_of_signal in (("kill -9", signal.SIGKILL), ("SIGSTOP, SIGCONT", signal.SIGSTOP)):
            outcome = _one(folder / f"{number}_{what.split()[0]}", name, number_of_signal, chance)
            kind = f"simulated graph: {name}: {what}"
            found.setdefault(kind, []).append(outcome)
            say(kind, outcome)


def _one(bag: Path, name: str, number: int, chance: random.Random) -> Outcome:
    lines: list[str] = []
    found = Outcome()
    run = GraphRun(
        load_graph("dc_motor", VALUES | {"bag": str(bag)}), say=lambda label, line: lines.append(f"{label}: {line}")
    )
    try:
        victim = next(one.process for one in run._children if one.label == name)  # noqa: SLF001
        size = chance.randrange(20_000, 1_500_000)
        _until(lambda: sum(file.stat().st_size for file in bag.glob("*.mcap")) > size)
        victim.send_signal(number)
        if number == signal.SIGSTOP:
            threading.Event().wait(chance.uniform(0.1, 2.0))
            victim.send_signal(signal.SIGCONT)
            begin = time.monotonic()
            run.wait()
            found.back = time.monotonic() - begin
        else:
            try:
                run.wait()
                found.wrong.append("the launcher did not notice")
            except IdloopError as error:
                if f"node {name} was killed by signal 9" not in str(error) or "\n" in str(error):
                    found.wrong.append(f"the launcher said {str(error)!r}")
    except IdloopError as error:
        found.wrong.append(str(error))
    finally:
        run.stop()
    if any("Traceback" in line for line in lines):
        found.wrong.append("a traceback")
    found.wrong += _kept(bag, number, name) + leftovers(str(bag.parent), [])
    return found


def _kept(bag: Path, number: int, name: str) -> list[str]:
    """What is wrong with the recording: every sample from the first to the last must be there."""
    if number == signal.SIGKILL and name == "recorder":
        recover_bag(bag, bag.with_name(f"{bag.name}_saved"))
        bag = bag.with_name(f"{bag.name}_saved")
    stamps = read_streams(bag)["/joint_states"].stamp_ns
    wrong = [] if (stamps[1:] - stamps[:-1] == 10_000_000).all() else ["samples are missing within the recording"]
    if number == signal.SIGSTOP and len(stamps) != SAMPLES:
        wrong.append(f"{len(stamps)} samples of {SAMPLES}")
    return wrong


def _until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise IdloopError("the graph did not start")
        threading.Event().wait(0.01)
