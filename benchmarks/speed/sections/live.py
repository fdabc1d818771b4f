"""The live graph: what the estimator takes of a core in real time, and how fast lock-step goes."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import re
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from speed.contest import Contest
from speed.progress import say
from speed.result import Claim, Row, Section

sys.path.append(str(Path(__file__).resolve().parents[2]))

from workbench import children, command_line, own_and_kernel

DOMAIN = 94
AGE = "samples measured while the estimator learns, for milliseconds every 0.4 s, or while others have the cores, wait"
REAL, STEPS = "torsion at 1 kHz in real time", "torsion in lock-step"
STATES, PREDICTION = "/joint_states", "/estimator/prediction"
SETTLED = 2.0  # s after which ages count


@dataclass
class Watched:
    """What a run took.

    Attributes
    ----------
    passed : float
        Wall time from the first step to the last [s].
    spent : dict
        Processor time of each node, and of the estimator's worker, meanwhile [s].
    kernel : dict
        What of it the kernel took [s].
    """

    passed: float = 0.0
    spent: dict[str, float] = field(default_factory=dict)
    kernel: dict[str, float] = field(default_factory=dict)

    def kernel_shares(self) -> dict[str, float]:
        """Part of the kernel in what each node took [%]."""
        return {name: 100.0 * self.kernel[name] / spent for name, spent in self.spent.items() if spent > 0.0}


def run(contest: Contest) -> Section:
    """One run in real time and one in lock-step."""
    section = Section("live", "Live graph: torsion, four outputs, 1 kHz, recorder and estimator on")
    for package in ("rclpy", "idloop_nodes"):
        if importlib.util.find_spec(package) is None:
            section.rows.append(Row(REAL, "idloop", note=f"not installed: {package}"))
            return section
    real_time(section, 8.0 if contest.quick else contest.live_seconds)
    lock_step(section, 5.0 if contest.quick else 60.0)
    section.remarks.append(
        "Five processes over DDS. A prediction's age is the time at which it reached the recorder (not at which that"
        " took it) less the stamp of its measurement. Fits run in a worker process of their own, beside the estimator;"
        " it is counted apart."
    )
    return section


def real_time(section: Section, length: float) -> None:
    """Share of a core, lost samples and age."""
    from idloop.records import read_streams

    say(f"{REAL}, {length:g} s")
    with tempfile.TemporaryDirectory() as place:
        bag = Path(place) / "bag"
        watched = graph(bag, length, mode="realtime")
        streams = read_streams(bag, [STATES, PREDICTION])
    states, predictions = streams[STATES], streams[PREDICTION]
    age = (predictions.receive_ns - predictions.stamp_ns) * 1e-6
    settled = age[predictions.stamp_ns > predictions.stamp_ns[0] + SETTLED * 1e9]
    expected = int(np.round((states.stamp_ns[-1] - states.stamp_ns[0]) * 1e-6)) + 1
    lost = expected - len(states.stamp_ns) + len(np.setdiff1d(states.stamp_ns, predictions.stamp_ns))
    worst = float(np.percentile(settled, 99.0))
    share = 100.0 * watched.spent.get("estimator", float("nan")) / length
    row = Row(REAL, "idloop", length, 1)
    row.answer = {"samples": float(expected), "lost or not predicted": float(lost)}
    row.answer |= {
        "age, median [ms]": float(np.median(settled)),
        "age, 99 % [ms]": worst,
        "age, largest [ms]": float(np.max(settled)),
    }
    row.answer |= {f"{name} [% of a core]": 100.0 * spent / length for name, spent in watched.spent.items()}
    section.rows.append(row)
    section.claims += [
        Claim("estimator at 1 kHz, share of one core", 25.0, share, "%", at_least=False),
        Claim(f"samples lost or not predicted in {length:g} s", 0.0, float(lost), "", at_least=False),
        Claim("age of the prediction, 99 %", 5.0, worst, "ms", at_least=False, limit=AGE),
    ]


def lock_step(section: Section, length: float) -> None:
    """Steps a second, and what each hop costs."""
    say(f"{STEPS}, {length:g} s of simulated time")
    with tempfile.TemporaryDirectory() as place:
        watched = graph(Path(place) / "bag", length, mode="lockstep", fit_period="0.0")
    steps = 1000.0 * length
    rate = steps / watched.passed
    row = Row(STEPS, "idloop", watched.passed / steps, 1)
    costs = {name: 1e6 * spent / steps for name, spent in watched.spent.items()}
    row.answer = {"steps a second": rate} | {f"{name} [µs a step]": cost for name, cost in costs.items()}
    row.answer |= {f"{name}, the kernel's part [%]": share for name, share in watched.kernel_shares().items()}
    section.rows.append(row)
    limit = f"each step costs {sum(costs.values()):.0f} µs of processor in the five processes together"
    section.claims.append(Claim("closed-loop steps a second in lock-step", 3000.0, rate, "1/s", limit=limit))


def graph(bag: Path, length: float, **values: str) -> Watched:
    """Run the torsion graph to its end and watch it from the plant's first step to its last."""
    from idloop.graph import GraphRun, load_graph

    lines: list[str] = []
    instants: dict[str, float] = {}

    def hear(label: str, line: str) -> None:
        lines.append(f"{label}: {line}")
        for word in ("start", "end"):
            if label == "plant" and f"[plant]: {word}: " in line:
                instants[word] = time.monotonic()

    settings = {"duration": str(length), "bag": str(bag), "auto_diagnose": "false", **values}
    before: dict[int, tuple[float, float]] = {}
    after: dict[int, tuple[str, tuple[float, float]]] = {}
    run = GraphRun(load_graph("torsion", settings), say=hear, domain_id=DOMAIN)
    try:
        while "end" not in instants and len(run.running) == len(run.graph.nodes):
            for process in children(os.getpid()):
                name = node_of(process)
                if name:
                    spent = own_and_kernel(process)
                    if "start" in instants:
                        before.setdefault(process, spent)
                    after[process] = name, spent
            time.sleep(0.1)
    finally:
        run.stop()
    if set(instants) != {"start", "end"}:
        raise SystemExit("the graph did not come to its end:\n" + "\n".join(lines[-5:]))
    watched = Watched(instants["end"] - instants["start"])
    for process, (name, spent) in after.items():
        own, kernel = np.subtract(spent, before.get(process, spent)).tolist()
        watched.spent[name] = watched.spent.get(name, 0.0) + own + kernel
        watched.kernel[name] = watched.kernel.get(name, 0.0) + kernel
    return watched


def node_of(process: int) -> str | None:
    """Name of the node that a process is."""
    with contextlib.suppress(OSError):
        if Path(f"/proc/{process}/comm").read_text(encoding="utf-8").strip() == "estimator work":
            return "estimator's worker"
    found = re.search(r"-m idloop_nodes (\w+)", command_line(process))
    return found.group(1) if found else None
