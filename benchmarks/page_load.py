"""The page alone, fed with many signals at 1 kHz: how soon it shows something, pictures a second, memory and its slope.

    .venv/bin/python benchmarks/page_load.py                       # twelve signals, five minutes
    .venv/bin/python benchmarks/page_load.py --signals 4 --duration 60
    .venv/bin/python benchmarks/page_load.py --duration 0          # how soon it shows something, alone

No graph is needed: a process feeds what the workbench's node would get, each signal measured, predicted and with its
residual, and the command; every five seconds new evidence and a new free run, as on a live graph.
Chromium's memory is the sum of the proportional set size (what several of them share is counted once) of the processes
that the page needs: all but the renderers of Chromium's own start page and of the page that it keeps in reserve, which
are told beside it, as is a browser with an empty page (about:blank), by process: that is what Chromium takes by itself.
There is a look every ten seconds; the slope is that of a line through the looks of the second half, and the hour what
it comes to.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from workbench import BROWSER, Page, children, command_line, resident, say, seconds

from idloop.physics import Model, simulate
from idloop.physics.model_file import from_text
from idloop.reporting.page.chromium import find_chromium

RATE = 1000  # samples a second
PERIOD = 20.0  # seconds after which the machine moves the same way again
LOOK = 10.0  # seconds between two looks at the memory
# What was asked of the page: pictures a second, memory [MB], seconds until the first picture.
WANTED = {"pictures": 30.0, "server": 250.0, "browser": 400.0, "first": 1.0}
VISITS = 5
EVIDENCE = 5.0  # seconds between two looks at the evidence, the estimator's own period
MOST = 600  # looks at the evidence that are kept, as on a live graph
FIRST = """() => ({
  paint: performance.getEntriesByName("first-contentful-paint")[0]?.startTime,
  picture: performance.getEntriesByName("idloop-first-picture")[0]?.startTime,
  words: performance.getEntriesByName("idloop-words")[0]?.startTime,
  figures: performance.getEntriesByName("idloop-figures")[0]?.startTime,
})"""


def chain(signals: int) -> Model:
    """Bodies in a row, each with its position and velocity measured."""
    count = (signals + 1) // 2
    names = [f"joint{number}" for number in range(1, count + 1)]
    bodies = [f"{{name: {name}, inertia: 1.0e-3, viscous_friction: 5.0e-3}}" for name in names]
    couplings = [
        f"{{from: {one}, to: {other}, stiffness: 2.0, damping: 1.0e-2}}" for one, other in itertools.pairwise(names)
    ]
    outputs = [
        f"{{topic: joint_states, joint: {name}, field: {quantity}, unit: {unit}, noise: {noise}}}"
        for name in names
        for quantity, unit, noise in (("position", "rad", 1e-3), ("velocity", "rad/s", 2e-2))
    ][:signals]
    lines = [
        "schema: idloop/model/1",
        "name: chain",
        f"input: {{topic: joint_command, joint: {names[0]}, field: effort, unit: N·m}}",
        "outputs:", *(f"  - {one}" for one in outputs),
        "bodies:", *(f"  - {one}" for one in bodies),
        "couplings:", *(f"  - {one}" for one in couplings),
    ]  # fmt: skip
    return from_text("\n".join(lines if couplings else lines[:-1]) + "\n", None)


def motion(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Command and outputs over one period, which the next one repeats."""
    time_ = np.arange(0.0, 2.0 * PERIOD, 1.0 / RATE)
    phases = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, 12)
    tones = [np.sin(2.0 * np.pi * (k + 1) / PERIOD * time_ + phase) for k, phase in enumerate(phases)]
    command = 0.02 * np.sum(tones, axis=0)
    output = simulate(model, time_, command, time_).output
    last = slice(len(time_) // 2, None)
    return command[last], output[last]


def feed(signals: int) -> None:
    """Serve the page and feed it until the standard input ends; the address goes to the standard output."""
    from idloop.reporting.workbench.server import Place, Site
    from idloop.reporting.workbench.state import Evidence, Fit, Health
    from idloop_nodes.workbench_page.source import LiveSource

    model = chain(signals)
    # Not in this process: what compiles and runs a simulation takes memory that no workbench does.
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        command, output = pool.submit(motion, model).result()
    rng = np.random.default_rng(2)
    spread = np.array([float(one.noise or 0.0) for one in model.outputs])
    noise = spread * rng.standard_normal((7919, len(spread)))
    source = LiveSource(model.with_effects(["load_torque@joint1(torque=0.001)"]), 120 * RATE, lambda: PERIOD)
    source.state.change(
        fit=Fit(dict.fromkeys(model.output_names, 98.0), {}, 4.0, source.state.snapshot.effects),
        health=tuple(Health(f"plant: check {number}", 0, "1000 samples/s") for number in range(6)),
        limits=(("command", "at most 1 N·m"),),
    )
    site = Site(source, Place())
    print(site.address, flush=True)
    ended = threading.Event()

    def wait() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=wait, daemon=True).start()
    begun, fed, looks = time.monotonic(), 0, 0
    grown: dict[str, tuple[float, ...]] = {f"{name}@joint1": () for name in (
        "coulomb_friction", "quadratic_drag", "cogging", "stribeck_friction", "load_torque", "backlash",
    )}  # fmt: skip
    while not ended.wait(0.02):
        count = int((time.monotonic() - begun) * RATE) - fed
        at = fed + np.arange(count)
        fed += count
        stamps = 10**9 + at * (10**9 // RATE)
        clean = output[at % len(output)]
        measured = clean + noise[at % len(noise)]
        for stream, values in (("measured", measured), ("command", command[at % len(command), None]),
                               ("predicted", clean), ("residual", measured - clean)):  # fmt: skip
            source.signals.extend(stream, stamps, values)
        if fed == count:
            continue
        if source.state.snapshot.assessment is None and fed > 5 * RATE:
            source.want("assess")
        source.work()
        if fed > looks * EVIDENCE * RATE:
            looks += 1
            grown = {
                name: (*line, 0.1 * k * looks + float(rng.normal()))[-MOST:]
                for k, (name, line) in enumerate(grown.items())
            }
            shown = tuple(EVIDENCE * number for number in range(looks))[-MOST:]
            source.state.change(
                evidence=Evidence("nothing decided", source.state.snapshot.effects, shown, grown, 6.4),
                fit=replace(source.state.snapshot.fit, seconds=float(looks)),
            )
    site.close()
    source.close()


@contextlib.contextmanager
def served(signals: int) -> Iterator[tuple[str, int]]:
    """Feed the page in a process of its own; yields its address and the process."""
    words = [sys.executable, __file__, "--feed", "--signals", str(signals)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None  # noqa: S101, PT018  (they are pipes)
        yield process.stdout.readline().strip(), process.pid
        process.stdin.close()


def slope(minutes: Sequence[float], sizes: Sequence[float]) -> float:
    """Growth over the second half [MB a minute]."""
    half = len(sizes) // 2
    return float(np.polyfit(minutes[half:], sizes[half:], 1)[0]) if len(sizes) - half > 1 else 0.0


def needed(processes: Sequence[int]) -> list[int]:
    """Those of Chromium's processes that the page needs: of the renderers the one that works most."""
    renderers = [one for one in processes if "--type=renderer" in command_line(one)]
    others = set(renderers) - {max(renderers, key=lambda one: seconds([one]), default=0)}
    return [one for one in processes if one not in others]


def by_kind(processes: Sequence[int]) -> dict[str, float]:
    """Memory of Chromium's processes by what they do [MB]."""
    found: dict[str, float] = {}
    for one in processes:
        words = command_line(one).split()
        kind = next((word.partition("=")[2] for word in words if word.startswith("--type=")), "browser")
        found[kind] = found.get(kind, 0.0) + resident([one])
    return found


def empty_page(driver: Any) -> dict[str, float]:
    """Memory of what a page without anything needs of the browser, by process [MB]."""
    before = set(children(os.getpid()))
    browser = driver.chromium.launch(executable_path=find_chromium(), args=list(BROWSER))
    page = browser.new_page()
    page.goto("about:blank")
    page.wait_for_timeout(5000)
    found = by_kind(
        needed([one for one in children(os.getpid()) if one not in before and "chrom" in command_line(one)])
    )
    browser.close()
    return found


def first_pictures(driver: Any, address: str) -> list[dict[str, float | None]]:
    """Milliseconds from asking for the page to what it shows first, in browsers that have seen nothing before."""
    found = []
    for _ in range(VISITS):
        browser = driver.chromium.launch(executable_path=find_chromium(), args=list(BROWSER))
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.wait_for_timeout(2000)  # Chromium itself has started
        page.goto(address, wait_until="commit")
        page.wait_for_function("() => performance.getEntriesByName('idloop-figures').length", timeout=60_000)
        found.append(dict(page.evaluate(FIRST)))
        browser.close()
    return found


def watched(page: Page, server: int, duration: float) -> dict[str, Any]:
    """Let the page run, and note pictures and memory."""
    begin = time.monotonic()
    drawn, used = page.pictures, (seconds(page.processes), seconds([server]))
    looks: list[dict[str, float]] = []
    loads: list[float] = []
    while True:
        now = time.monotonic() - begin
        looks.append(
            {
                "minute": now / 60.0,
                "server": resident([server]),
                "browser": resident(needed(page.processes)),
                "all": resident(page.processes),
                "pictures": page.pictures - drawn,
            }
        )
        loads.append(os.getloadavg()[0])
        say(", ".join(f"{name} {value:.1f}" for name, value in looks[-1].items()))
        if now >= duration:
            break
        time.sleep(min(LOOK, max(duration - now, 0.1)))
    length = time.monotonic() - begin
    minutes = [one["minute"] for one in looks]
    memory = {
        name: {
            "first": sizes[0],
            "last": sizes[-1],
            "most": max(sizes),
            "slope": slope(minutes, sizes),
            "hour": sizes[-1] + max(slope(minutes, sizes), 0.0) * max(60.0 - minutes[-1], 0.0),
        }
        for name in ("server", "browser")
        for sizes in [[one[name] for one in looks]]
    }
    return {
        "length": length,
        "pictures": looks[-1]["pictures"] / length,
        "memory": memory,
        "kinds": by_kind(needed(page.processes)),
        "all": looks[-1]["all"],
        "heap": page.heap(),
        "streams": page.streams,
        "processor": {
            "browser": (seconds(page.processes) - used[0]) / length,
            "server": (seconds([server]) - used[1]) / length,
        },
        "load": loads,
        "complaints": page.complaints,
    }


def report(found: dict[str, Any]) -> list[str]:
    """The result in lines, each with what was asked for."""
    lines = []
    for name, title in (("paint", "first words"), ("picture", "first picture of the strips"),
                        ("words", "all words"), ("figures", "first figure")):  # fmt: skip
        times = [one[name] for one in found["first"] if one[name] is not None]
        wanted = f" (wanted: {WANTED['first']:g} s)" if name in ("paint", "picture") else ""
        if times:
            lines.append(f"{title}: median {np.median(times) / 1e3:.2f} s, latest {max(times) / 1e3:.2f} s{wanted}")
    run = found.get("run")
    if run is None:
        return lines
    lines.append(f"pictures a second: {run['pictures']:.1f} (wanted: {WANTED['pictures']:g})")
    for name, one in run["memory"].items():
        lines.append(
            f"memory of the {name}: {one['first']:.0f} to {one['last']:.0f} MB, most {one['most']:.0f}, "
            f"{one['slope']:+.2f} MB a minute, {one['hour']:.0f} MB after an hour at this slope "
            f"(wanted: {WANTED[name]:g})"
        )
    kinds, empty = (
        ", ".join(f"{kind} {size:.0f}" for kind, size in one.items()) for one in (run["kinds"], found["empty"])
    )
    lines.append(f"browser by process [MB]: {kinds}; {run['all']:.0f} with Chromium's own pages")
    lines.append(f"Chromium with an empty page: {sum(found['empty'].values()):.0f} MB ({empty})")
    lines.append(f"JavaScript heap after a collection {run['heap']:.1f} MB, points {run['streams']:.2f} MB")
    cores = (f"{name} {100.0 * share:.0f} %" for name, share in run["processor"].items())
    lines.append(f"processor, of one core: {', '.join(cores)}")
    lines.append(f"load of the machine: {min(run['load']):.1f} to {max(run['load']):.1f}")
    lines.append(f"complaints of the browser: {run['complaints'] or 'none'}")
    return lines


def main() -> None:
    """Run it and print the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--signals", type=int, default=12, help="outputs that are measured")
    parser.add_argument("--duration", type=float, default=300.0, help="seconds with the page open")
    parser.add_argument("--feed", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--json", type=Path, help="write everything here as well")
    given = parser.parse_args()
    if given.feed:
        feed(given.signals)
        return
    from playwright.sync_api import sync_playwright

    found: dict[str, Any] = {}
    with served(given.signals) as (address, server), sync_playwright() as driver:
        time.sleep(8.0)  # a first free run is there
        found["empty"] = empty_page(driver)
        found["first"] = first_pictures(driver, address)
        if given.duration > 0.0:
            page = Page(driver, address)
            found["run"] = watched(page, server, given.duration)
            page.browser.close()
    print("\n".join(report(found)))
    if given.json:
        given.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
