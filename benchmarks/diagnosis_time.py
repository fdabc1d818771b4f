"""How long a diagnosis of the whole catalogue takes, and how time and memory grow with the record.

A machine of the diagnosis suite, sampled at 1 kHz in one recording, with and without an effect hidden in it; then a
machine of one body of which the force balance decides: a diagnosis, a ladder of three effects, and diagnoses of long
records with the peak of memory, each in a process of its own. The first run of all is not counted: it loads the
compiled code.

    .venv/bin/python benchmarks/diagnosis_time.py
    .venv/bin/python benchmarks/diagnosis_time.py --case 'single/dead_zone/dc_motor/input/clear' --seconds 60
    .venv/bin/python benchmarks/diagnosis_time.py --samples 100000 1000000 10000000
    .venv/bin/python benchmarks/diagnosis_time.py --beside ../other  # the same with another checkout's source
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
sys.path.insert(0, str(Path(__file__).resolve().parent / "diagnosis"))

from case import Case
from cases import cases_of
from experiment import Experiment, experiment

import idloop
from idloop.diagnosis import diagnose, refine
from idloop.diagnosis.ladder import Ladder

_RATE = 1000.0
_USUAL = "single/coulomb_friction/axis/axis/clear"
# The same machine with three effects, for a ladder.
_LADDER = "triple/coulomb_friction+input_offset+imbalance/axis/1"


def longer(case: Case, seconds: float, *, hidden: bool = True) -> Case:
    """The case as one recording of so many seconds at 1 kHz."""
    truth = case.hidden if hidden else ()
    return replace(
        case, simulator="idloop", training=case.training[:1], rate=_RATE, duration=seconds, hidden=truth
    )  # fmt: skip


def timed(data: Experiment, *, ladder: bool) -> tuple[float, float, str]:
    """Seconds that pass, seconds of all processors, and the answer."""
    begin, used = time.perf_counter(), time.process_time()
    found = (refine if ladder else diagnose)(data.start, data.training)
    passed, busy = time.perf_counter() - begin, time.process_time() - used
    names = found.added if isinstance(found, Ladder) else found.set
    return passed, busy, f"{', '.join(names) or found.verdict} by {found.criterion}"


def row(what: str, case: Case, repeat: int, *, ladder: bool = False) -> None:
    """Time one recording and print it."""
    data = experiment(case)
    runs = [timed(data, ladder=ladder) for _ in range(repeat)]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(
        f"{what:>24} {case.duration:11g} {case.duration * case.rate:9.0f} {median(r[0] for r in runs):11.2f}"
        f" {median(r[1] for r in runs):15.2f} {memory:10.0f}  {runs[-1][2]}",
        flush=True,
    )


def again(folder: Path, arguments: Sequence[str]) -> None:
    """The same benchmark in a process of its own, with the source of some checkout."""
    environment = {**os.environ, "PYTHONPATH": str(folder.resolve() / "src")}
    subprocess.run([sys.executable, __file__, *arguments], env=environment, check=False)


def main() -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", default=_USUAL, help=f"id of a case of the suite (default {_USUAL})")
    parser.add_argument("--seconds", type=float, nargs="*", default=[15.0, 60.0, 120.0], help="record lengths")
    parser.add_argument("--samples", type=int, nargs="*", default=[100_000, 300_000, 1_000_000], help="long records")
    parser.add_argument("--repeat", type=int, default=3, help="runs, of which the median is shown (default 3)")
    parser.add_argument("--beside", type=Path, metavar="FOLDER", help="time the source of another checkout, too")
    parser.add_argument("--single", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    cases = {case.id: case for case in cases_of({arguments.case, _USUAL}.__contains__)}
    if arguments.case not in cases:
        parser.error(f"there is no case {arguments.case!r}: see benchmarks/diagnosis/cases.py")
    case, one_body = cases[arguments.case], cases[_USUAL]
    timed(experiment(longer(one_body, 5.0)), ladder=False)
    if arguments.single:
        row("long record", longer(one_body, arguments.single / _RATE), 1)
        return 0
    print(f"{case.id}, {_RATE:g} Hz, median of {arguments.repeat}")
    columns = f"{'record [s]':>11} {'samples':>9} {'passed [s]':>11} {'processors [s]':>15} {'peak [MB]':>10}"
    print(f"{'hidden':>24} {columns}  answer")
    for hidden in (False, True):
        for seconds in arguments.seconds:
            row(case.effect if hidden else "nothing", longer(case, seconds, hidden=hidden), arguments.repeat)
    row("one body", longer(one_body, 60.0), arguments.repeat)
    row("... ladder", longer(cases[_LADDER], 60.0), arguments.repeat, ladder=True)
    for samples in arguments.samples:
        again(Path(idloop.__file__).parents[2], ["--single", str(samples)])
    if arguments.beside is not None:
        print(f"\nwith {arguments.beside}", flush=True)
        shown = ["--case", arguments.case, "--repeat", str(arguments.repeat)]
        for option, values in (("--seconds", arguments.seconds), ("--samples", arguments.samples)):
            shown += [option, *map(str, values)]
        again(arguments.beside, shown)
    return 0


if __name__ == "__main__":
    sys.exit(main())
