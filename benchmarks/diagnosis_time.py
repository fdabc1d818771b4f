"""How long a diagnosis of the whole catalogue takes, and how that grows with the record.

A machine of the diagnosis suite, sampled at 1 kHz in one recording, with and without an effect hidden in it. One
warm-up run is not counted: it loads the compiled code.

    .venv/bin/python benchmarks/diagnosis_time.py
    .venv/bin/python benchmarks/diagnosis_time.py --case 'single/dead_zone/dc_motor/input/clear' --seconds 60
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent / "diagnosis"))

from case import Case
from cases import all_cases
from experiment import experiment

from idloop.diagnose import diagnose

_RATE = 1000.0
_USUAL = "single/coulomb_friction/axis/axis/clear"


def longer(case: Case, seconds: float, hidden: bool) -> Case:
    """The case as one recording of so many seconds at 1 kHz."""
    truth = case.hidden if hidden else ()
    return replace(
        case, simulator="idloop", training=case.training[:1], rate=_RATE, duration=seconds, hidden=truth
    )  # fmt: skip


def timed(case: Case) -> tuple[float, float, str]:
    """Seconds that pass, seconds of all processors, and the answer."""
    data = experiment(case)
    begin, used = time.perf_counter(), time.process_time()
    found = diagnose(data.start, data.training)
    passed, busy = time.perf_counter() - begin, time.process_time() - used
    return passed, busy, ", ".join(found.set) or found.verdict


def main() -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", default=_USUAL, help=f"id of a case of the suite (default {_USUAL})")
    parser.add_argument("--seconds", type=float, nargs="+", default=[15.0, 30.0, 60.0, 120.0], help="record lengths")
    parser.add_argument("--repeat", type=int, default=3, help="runs, of which the median is shown (default 3)")
    arguments = parser.parse_args()
    case = next((c for c in all_cases() if c.id == arguments.case), None)
    if case is None:
        parser.error(f"there is no case {arguments.case!r}: see benchmarks/diagnosis/cases.py")
    timed(longer(case, 5.0, True))
    print(f"{case.id}, {_RATE:g} Hz, median of {arguments.repeat}")
    print(f"{'hidden':>24} {'record [s]':>11} {'samples':>9} {'passed [s]':>11} {'processors [s]':>15}  answer")
    for hidden in (False, True):
        for seconds in arguments.seconds:
            runs = [timed(longer(case, seconds, hidden)) for _ in range(arguments.repeat)]
            what = case.effect if hidden else "nothing"
            print(
                f"{what:>24} {seconds:11g} {seconds * _RATE:9.0f} {median(r[0] for r in runs):11.2f}"
                f" {median(r[1] for r in runs):15.2f}  {runs[-1][2]}",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
