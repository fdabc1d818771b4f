"""The page on a graph at 1 kHz with four outputs: pictures a second, memory, and what the graph loses because of it.

    .venv/bin/python benchmarks/workbench.py                   # ten minutes with the page open, after two without
    .venv/bin/python benchmarks/workbench.py --duration 60 --baseline 30
    .venv/bin/python benchmarks/workbench.py mode:=lockstep real_time_factor:=1.0     # where other work takes the cores

It starts the torsion graph in real time with the workbench, lets it run without any browser, opens the page in headless
Chromium, and reads the counters of all nodes before and after each of the two. What other programs take of the machine
meanwhile is part of the result: the load is printed beside it.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from idloop.graph import GraphRun, load_graph
from idloop.reporting.page.chromium import find_chromium

START = 300.0  # seconds until every node is heard of: a cold cache has the model compiled
BROWSER = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update")
# Counters of a check that say how much was done, and those that say what went wrong.
COUNTERS = {
    "plant: loop": ("steps", "late_commands", "missed_deadlines"),
    "controller: loop": ("answers", "silences", "missed_deadlines"),
    "estimator: prediction": ("samples", "restarts"),
    "recorder: recording": ("received/joint_states", "lost/joint_states", "lost/joint_command", "dropped_by_queue"),
}
# Those that must not grow because of the page.
LOSSES = {
    "controller: loop": ("silences",),
    "estimator: prediction": ("restarts",),
    "recorder: recording": ("lost/joint_states", "lost/joint_command", "dropped_by_queue"),
}
ENOUGH = 10.0  # pictures a second
SILENT = 3  # level of a check that is heard no more
MINUTE = 60.0  # seconds between two looks at the memory: a collection of the browser's garbage goes before each
HZ = os.sysconf("SC_CLK_TCK")


def say(text: str) -> None:
    """Progress."""
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


def ask(address: str) -> dict[str, Any]:
    """State of the page; empty while the node is too busy to answer."""
    try:
        with urllib.request.urlopen(f"{address}state", timeout=20.0) as response:  # noqa: S310  (our own)
            return dict(json.loads(response.read()))
    except (OSError, urllib.error.URLError):
        return {}


def children(root: int) -> list[int]:
    """A process and all below it."""
    found, todo = [], [root]
    while todo:
        one = todo.pop()
        found.append(one)
        with contextlib.suppress(OSError):
            for task in Path(f"/proc/{one}/task").iterdir():
                todo += [int(child) for child in (task / "children").read_text().split()]
    return found


def command_line(process: int) -> str:
    """Words with which a process was started."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_text().replace("\0", " ")
    return ""


def seconds(processes: Sequence[int]) -> float:
    """Processor time of processes [s]."""
    return sum(sum(own_and_kernel(one)) for one in processes)


def own_and_kernel(process: int) -> tuple[float, float]:
    """Processor time of a process, its own and that of the kernel on its behalf [s]; zero when it is gone."""
    with contextlib.suppress(OSError):
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        return int(fields[11]) / HZ, int(fields[12]) / HZ
    return 0.0, 0.0


def resident(processes: Sequence[int]) -> float:
    """Memory of processes [MB], what they share counted once each."""
    total = 0.0
    for one in processes:
        with contextlib.suppress(OSError):
            text = Path(f"/proc/{one}/smaps_rollup").read_text()
            total += sum(int(line.split()[1]) for line in text.splitlines() if line.startswith("Pss:")) / 1e3
    return total


@dataclass
class Phase:
    """What one stretch of the run came to."""

    name: str
    begin: dict[str, dict[str, int]] = field(default_factory=dict)
    end: dict[str, dict[str, int]] = field(default_factory=dict)
    load: list[float] = field(default_factory=list)
    length: float = 0.0
    pictures: list[float] = field(default_factory=list)  # a second, by part
    memory: list[dict[str, float]] = field(default_factory=list)
    processor: dict[str, float] = field(default_factory=dict)  # share of one core

    def count(self, check: str, name: str) -> int:
        """By how much a counter has grown."""
        return self.end.get(check, {}).get(name, 0) - self.begin.get(check, {}).get(name, 0)


def counters(address: str) -> dict[str, dict[str, int]]:
    """Counters of all checks as they were last told; on a machine that is too busy a node may not come to tell."""
    checks: dict[str, Any] = {}
    for _ in range(20):
        checks = {one["name"]: one for one in ask(address).get("health", ())}
        silent = [name for name in COUNTERS if name not in checks or checks[name]["level"] >= SILENT]
        if not silent:
            break
        time.sleep(1.0)
    else:
        say(f"nothing is heard of {', '.join(silent)}: this machine is too busy for this graph")
    return {
        name: {key: int(checks[name]["values"].get(key, 0)) for key in keys}
        for name, keys in COUNTERS.items()
        if name in checks
    }


def watch(phase: Phase, address: str, span: float, part: float, page: Page | None, node: int) -> Phase:
    """Let a stretch pass and note what happens in it."""
    phase.begin = counters(address)
    begin = time.monotonic()
    used = seconds([node]), seconds(page.processes) if page else 0.0
    drawn, last = page.pictures if page else 0, begin
    phase.memory.append(memory(page, node))
    looked = begin
    while time.monotonic() < begin + span:
        time.sleep(max(min(part, begin + span - time.monotonic()), 0.1))
        now = time.monotonic()
        phase.load.append(os.getloadavg()[0])
        if page is not None:
            pictures = page.pictures
            phase.pictures.append((pictures - drawn) / (now - last))
            drawn, last = pictures, now
            say(f"{phase.name}: {now - begin:.0f} of {span:g} s, {phase.pictures[-1]:.1f} pictures a second")
        else:
            say(f"{phase.name}: {now - begin:.0f} of {span:g} s")
        if now - looked >= MINUTE:
            looked = now
            phase.memory.append(memory(page, node))
            say("memory [MB]: " + ", ".join(f"{name} {size:.1f}" for name, size in phase.memory[-1].items()))
    phase.length = time.monotonic() - begin
    phase.memory.append(memory(page, node))
    phase.processor["node"] = (seconds([node]) - used[0]) / phase.length
    if page:
        phase.processor["browser"] = (seconds(page.processes) - used[1]) / phase.length
    phase.end = counters(address)
    return phase


def memory(page: Page | None, node: int) -> dict[str, float]:
    """Memory of node and browser [MB]."""
    found = {"node": resident([node])}
    if page is not None:
        found |= {"browser": resident(page.processes), "heap": page.heap(), "streams": page.streams}
    return found


class Page:
    """The page in headless Chromium.

    Parameters
    ----------
    driver : playwright.sync_api.Playwright
    address : str
    """

    def __init__(self, driver: Any, address: str) -> None:
        before = set(children(os.getpid()))
        self.browser = driver.chromium.launch(executable_path=find_chromium(), args=list(BROWSER))
        self.page = self.browser.new_page(viewport={"width": 1500, "height": 1000})
        self.complaints: list[str] = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type == "error" else None)
        self.page.set_default_timeout(60_000)
        self.page.goto(address)
        self.page.wait_for_selector("body[data-ready]")
        self.page.wait_for_function("() => strips.pictures > 0")
        self.processes = [one for one in children(os.getpid()) if one not in before and "chrom" in command_line(one)]
        self._tools = self.page.context.new_cdp_session(self.page)
        self._tools.send("Performance.enable")

    @property
    def pictures(self) -> int:
        """Drawn so far."""
        return int(self.page.evaluate("() => strips.pictures"))

    @property
    def streams(self) -> float:
        """Memory of the points that the page keeps [MB]."""
        return float(self.page.evaluate("() => strips.bytes")) / 1e6

    def heap(self) -> float:
        """JavaScript objects that are in use [MB]."""
        self._tools.send("HeapProfiler.collectGarbage")
        metrics = self._tools.send("Performance.getMetrics")["metrics"]
        return float(next(one["value"] for one in metrics if one["name"] == "JSHeapUsedSize")) / 1e6


def hurry(priority: int, page: int) -> None:
    """Give all nodes but the page's the real-time priority that a machine with a motor gives them."""
    for one in children(os.getpid()):
        if "idloop_nodes" in command_line(one) and one != page and "worker" not in command_line(one):
            for thread in Path(f"/proc/{one}/task").iterdir():
                os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(priority))


@contextlib.contextmanager
def running(given: argparse.Namespace, folder: Path) -> Iterator[tuple[str, int]]:
    """Start the graph; yields the page's address and the process that serves it."""
    lines: list[str] = []
    values = {
        "mode": "realtime", "duration": "0.0", "workbench": "true", "workbench_port": "0", "auto_diagnose": "false",
        "bag": str(folder / "bag"), **dict(one.split(":=", 1) for one in given.argument),
    }  # fmt: skip
    run = GraphRun(
        load_graph("torsion", values), say=lambda label, line: lines.append(f"{label}: {line}"), domain_id=given.domain
    )
    try:
        end = time.monotonic() + START
        address = ""
        while not (address and set(COUNTERS) <= {one["name"] for one in ask(address).get("health", ())}):
            if time.monotonic() > end or len(run.running) < len(run.graph.nodes):
                raise SystemExit("the graph does not get going:\n" + "\n".join(lines[-12:]))
            address = next((one.split(" at ")[-1].strip() for one in lines if "the workbench is at" in one), "")
            time.sleep(1.0)
        say(f"the page is at {address}")
        node = next(
            one for one in children(os.getpid()) if "nodes" in command_line(one) and "workbench" in command_line(one)
        )
        if given.priority:
            hurry(given.priority, node)
        yield address, node
    finally:
        run.stop()


def table(phases: Sequence[Phase]) -> list[tuple[str, ...]]:
    """Rows of the result."""
    rows = [("", *(one.name for one in phases)), ("length [s]", *(f"{one.length:.0f}" for one in phases))]
    rows.append(("load of the machine", *(f"{min(p.load):.1f} to {max(p.load):.1f}" for p in phases)))
    rows += [
        (f"{check.partition(':')[0]}: {name.replace('_', ' ')}", *(str(one.count(check, name)) for one in phases))
        for check, names in COUNTERS.items()
        for name in names
    ]
    rows.append((
        "measured, not predicted in time",
        *(str(p.count("plant: loop", "steps") - p.count("estimator: prediction", "samples")) for p in phases),
    ))  # fmt: skip
    rows.append(
        ("pictures a second, mean", *(f"{sum(p.pictures) / len(p.pictures):.1f}" if p.pictures else "" for p in phases))
    )
    rows.append(("pictures a second, fewest", *(f"{min(p.pictures):.1f}" if p.pictures else "" for p in phases)))
    for what, title in (
        ("node", "memory of the node"), ("browser", "memory of the browser"), ("heap", "heap of the page"),
        ("streams", "points of the page"),
    ):  # fmt: skip
        row = ([m[what] for m in p.memory if what in m] for p in phases)
        said = (f"{one[0]:.1f} to {one[-1]:.1f}, most {max(one):.1f}" if one else "" for one in row)
        rows.append((f"{title} [MB]", *said))
    rows += [
        (
            f"processor of the {what} [% of a core]",
            *(f"{100 * one.processor[what]:.0f}" if what in one.processor else "" for one in phases),
        )
        for what in ("node", "browser")
    ]
    return rows


def verdicts(before: Phase, opened: Phase) -> list[str]:
    """What was asked of the page, and whether it was reached.

    Parameters
    ----------
    before, opened : Phase
        Without the page, and with it.

    Returns
    -------
    list of str
        A line each: pictures, samples, memory.
    """
    slow = [(pictures, load) for pictures, load in zip(opened.pictures, opened.load, strict=False) if pictures < ENOUGH]
    said = f"{ENOUGH:g} pictures a second: "
    if slow:
        parts = f"{len(slow)} of {len(opened.pictures)} parts"
        calmest = min(load for _, load in slow)
        said += f"not reached in {parts}, fewest {min(slow)[0]:.1f}; the load was {calmest:.1f} or more in all of them"
    else:
        said += "reached in every part"
    late = [
        phase.count("plant: loop", "steps") - phase.count("estimator: prediction", "samples")
        for phase in (opened, before)
    ]
    lines = [said, f"measured, not predicted in time: {late[0]} with the page, {late[1]} without"]
    for check, names in LOSSES.items():
        for name in names:
            now, then = opened.count(check, name), before.count(check, name)
            share = now / max(opened.length, 1.0), then / max(before.length, 1.0)
            words = f"{check.partition(':')[0]}, {name.replace('_', ' ')}"
            lines.append(f"{words}: {now} with the page, {share[0]:.3g} a second; {share[1]:.3g} a second without")
    for what, title in (("node", "the node"), ("browser", "the browser"), ("heap", "the heap of the page")):
        sizes = [one[what] for one in opened.memory if what in one]
        half = sizes[len(sizes) // 2 :]
        lines.append(f"memory of {title}: {half[-1] - half[0]:+.1f} MB over the second half")
    return lines


def main() -> None:
    """Run it and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("argument", nargs="*", help="further arguments of the graph, as in fit_period:=30.0")
    parser.add_argument("--duration", type=float, default=600.0, help="seconds with the page open")
    parser.add_argument("--baseline", type=float, default=120.0, help="seconds without it, before")
    parser.add_argument("--part", type=float, default=10.0, help="seconds over which pictures are counted")
    parser.add_argument(
        "--priority", type=int, default=0, help="real-time priority of the nodes but the page's, 1 to 99"
    )
    parser.add_argument("--domain", type=int, default=93, help="ROS domain of the graph")
    parser.add_argument("--json", type=Path, help="write everything here as well")
    given = parser.parse_args()
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, running(given, Path(folder)) as (address, node):
        phases = [watch(Phase("without a page"), address, given.baseline, given.part, None, node)]
        with sync_playwright() as driver:
            page = Page(driver, address)
            phases.append(watch(Phase("with a page"), address, given.duration, given.part, page, node))
            complaints = page.complaints
            page.browser.close()
    rows = table(phases)
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        print("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())
    print("\n".join(["", *verdicts(*phases)]))
    print(f"complaints of the browser: {complaints or 'none'}")
    if given.json:
        given.json.write_text(json.dumps([vars(one) for one in phases], indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
