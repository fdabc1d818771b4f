"""idloop beside its peers on the same work, on this machine, in turn.

Installs the peers in an environment of their own (.peers/, versions in benchmarks/speed/peers.txt), runs each
contestant in a process of its own, checks that the answers agree, and writes benchmark.md, benchmark.json,
benchmark.png and scaling.png. Imports, compilation and the reading of the data are never timed. Octave's control
package takes part where it is installed (apt install octave octave-control), the plain C where gcc is.
"""

from __future__ import annotations

import argparse
import importlib
import os
import platform
import sys
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from speed import plot, table
from speed.contest import Contest
from speed.environment import ROOT, peers_python
from speed.progress import say
from speed.result import Section

SECTIONS = {
    "n4sid": "subspace identification against SLICOT, SIPPY and nfoursid",
    "simulation": "free runs against solve_ivp, MuJoCo and plain C",
    "greybox": "grey-box fits against compiled and plain least squares, jax-sysid and MuJoCo's sysid",
    "diagnosis": "the whole catalogue, a ladder of three, four bodies, growth with the record",
    "narx": "training of a network against scikit-learn, to the same error",
    "live": "the graph in real time and in lock-step: shares of a core, losses, ages, steps a second",
    "command_line": "help, compare, and the reading of bags against rosbags",
    "scaling": "our time and memory against samples, order, outputs and effects",
}


def machine() -> str:
    """Processor, cores and operating system."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines() if Path("/proc/cpuinfo").exists() else []
    name = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())
    return f"{os.cpu_count()} cores of {name}, Python {platform.python_version()}"


def parse() -> argparse.Namespace:
    """Command line."""
    listed = "\n".join(f"  {name:13s} {text}" for name, text in SECTIONS.items())
    parser = argparse.ArgumentParser(
        prog="launch_scripts/benchmark",
        description=__doc__,
        epilog=f"sections:\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--only", nargs="+", metavar="SECTION", choices=SECTIONS, help="sections to run (default all)")
    parser.add_argument("--quick", action="store_true", help="small work and two runs: to see that everything works")
    parser.add_argument("--long", action="store_true", help="records of 10^7 samples as well: needs 4 GB of memory")
    parser.add_argument(
        "--live-seconds", type=float, default=30.0, metavar="S", help="length of the live run (30; the report has 600)"
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=ROOT / "runs" / "benchmark",
        metavar="FOLDER",
        help="where results go (default runs/benchmark)",
    )
    parser.add_argument(
        "--clock",
        choices=("wall", "processor"),
        default="wall",
        help="what counts: time that passes (default), or processor time where others use the machine",
    )
    parser.add_argument(
        "--profile", action="store_true", help="where our own time goes, by function: profiles/ in the output folder"
    )
    parser.add_argument("--without-peers", action="store_true", help="ours alone: installs nothing")
    return parser.parse_args()


def main() -> int:
    """Run what was asked for; exit code 1 where an answer of ours does not agree."""
    given = parse()
    if not given.live_seconds > 0.0:
        raise SystemExit(f"--live-seconds {given.live_seconds:g}: give more than 0")
    peers = None if given.without_peers else peers_python()
    profiles = given.output / "profiles" if given.profile else None
    contest = Contest(peers, given.quick, given.long, given.live_seconds, given.clock == "processor", profiles)
    load = f"{os.getloadavg()[0]:.1f}"
    sections: list[Section] = []
    about: dict[str, Any] = {}
    for name in given.only or SECTIONS:
        say(f"== {name}: {SECTIONS[name]}")
        sections.append(importlib.import_module(f"speed.sections.{name}").run(contest))
        about = {
            "when": time.strftime("%Y-%m-%d"), "machine": machine(), "quick": given.quick, "clock": given.clock,
            "load": f"{load} before and {os.getloadavg()[0]:.1f} at the end",
        }  # fmt: skip
        # After each section, so that an interrupted run leaves what it has.
        table.write(sections, about, given.output)
    plot.draw_beside(sections, given.output / "benchmark.png")
    plot.draw_scaling({k: c for s in sections for k, c in s.curves.items()}, given.output / "scaling.png")
    print(table.markdown(sections, about))
    say(f"written to {given.output}")
    return int(any(row.agrees is False for section in sections for row in section.rows if row.who == "idloop"))


if __name__ == "__main__":
    sys.exit(main())
