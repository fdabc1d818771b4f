"""Run the diagnosis on the suite: one JSON line per case, in the order in which they end.

    python benchmarks/diagnosis/run.py --cases 40 --resume results.jsonl
    python benchmarks/diagnosis/run.py --only 'single/dead_zone/*' --level 0.05 --resume five.jsonl
    python benchmarks/diagnosis/report.py results.jsonl

A case that the file of results already holds, at the same level and seed, is not run again.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

# Two workers share the cores already: threads inside the linear algebra only get in their way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from case import CATEGORIES, Case

_BATCH = 80


def chosen(only: Sequence[str], categories: Sequence[str], count: int | None) -> list[Case]:
    """Cases by pattern and category; of many, as many from each category as its share."""
    from cases import cases_of

    cases = list(
        cases_of(
            lambda case_id: (
                (not only or any(fnmatch.fnmatch(case_id, pattern) for pattern in only))
                and (not categories or case_id.partition("/")[0] in categories)
            )
        )
    )
    if count is None or count >= len(cases):
        return cases
    rest: dict[str, list[Case]] = {}
    for case in cases:
        rest.setdefault(case.category, []).append(case)
    picked = {
        case.id for several in rest.values() for case in several[: max(round(count * len(several) / len(cases)), 1)]
    }
    # In the order of the suite, which mixes the categories: a run that is cut short is still a fair sample.
    return [case for case in cases if case.id in picked]


@dataclass(frozen=True)
class Settings:
    """What holds for all cases of a run.

    Attributes
    ----------
    suite : int
        Seed of the whole suite.
    level : float
        Family-wise error rate.
    judge : bool
        Also compute what needs fits of the true model.
    resolve : bool
        Run the suggested experiment where the case was untestable.
    limit : float
        Seconds of processor time after which a case is given up: what else runs on the machine has no part in it.
    """

    suite: int = 1
    level: float = 0.01
    judge: bool = True
    resolve: bool = False
    limit: float = 1200.0


def _give_up(*_: object) -> None:
    raise TimeoutError("took longer than the limit")


def attempt(case: Case, settings: Settings) -> dict[str, Any]:
    """Diagnose one case and judge the answer; never raises."""
    begin = time.process_time()
    row: dict[str, Any] = {"id": case.id, "level": settings.level, "seed": settings.suite, **conditions(case)}
    signal.signal(signal.SIGPROF, _give_up)
    signal.setitimer(signal.ITIMER_PROF, settings.limit)
    try:
        row |= _diagnosed(case, settings)
    except Exception as error:  # noqa: BLE001 (a case that fails is a result)
        row["error"] = f"{type(error).__name__}: {error}"
        row["traceback"] = traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    row["seconds_all"] = round(time.process_time() - begin, 2)
    return row


def conditions(case: Case) -> dict[str, Any]:
    """What the tables are sorted by."""
    return {
        "category": case.category,
        "effect": case.effect,
        "truth": list(case.truth),
        "values": {item.name: dict(item.values) for item in case.hidden},
        "machine": case.machine,
        "simulator": case.simulator,
        "loop": case.loop,
        "excitation": case.training[0].kind,
        "bags": len(case.training),
        "rate": case.rate,
        "duration": case.duration,
        "disturbance": case.disturbance.kind,
        "share": case.disturbance.share,
        "noise": case.noise.kind,
        "noise_told": case.noise.told,
        "quantised": bool(case.quantisation),
        "strength": case.strength,
        "trap": case.trap,
    }


def _diagnosed(case: Case, settings: Settings) -> dict[str, Any]:
    from experiment import experiment
    from judge import judged
    from score import rungs, score

    from idloop.diagnosis import refine

    data = experiment(case, settings.suite)
    begin = time.process_time()
    ladder = refine(data.start, data.training, data.validation, level=settings.level, seed=settings.suite)
    seconds = time.process_time() - begin
    added = rungs(ladder)
    result = score(case, data.start, added)
    row: dict[str, Any] = {
        "seconds": round(seconds, 2),
        "samples": sum(len(r.time) for r in data.training),
        "verdict": ladder.verdict,
        "criterion": ladder.criterion,
        "added": [
            {"name": r.name, "set": list(r.set), "replaces": r.replaces, "p_value": r.p_value, "gain": r.gain}
            for r in added
        ],
        "final": list(ladder.model.effect_names),
        "parameters": {n: v for n, v in ladder.model.values.items() if "@" in n},
        "untestable": list(ladder.untestable),
        "shows_from": {name: limit.to_dict() for name, limit in ladder.limits.items()},
        "found": list(result.found),
        "exact": result.exact,
        "false": list(result.false),
        "suggested": ladder.suggested_experiment is not None,
        # of the start and of the last model, on the unseen record
        "force_error": [ladder.steps[i].validation.get("force") for i in (0, -1)],
    }
    if case.nuisances is not None:
        from drive_oracle import worth

        row["worth"] = worth(case, settings.suite)
    elif settings.judge:
        row |= judged(case, data, ladder.model)
    if settings.resolve and case.category == "untestable":
        from resolve import resolved

        row |= resolved(case, data, ladder, settings.level, settings.suite)
    return row


def _keep_to_one_core(cores: Any) -> None:
    """As many workers as cores: threads of the one must not slow the other."""
    if hasattr(os, "sched_setaffinity"):
        own, core = sorted(os.sched_getaffinity(0)), cores.get()
        os.sched_setaffinity(0, {own[core % len(own)]})


def done_already(path: Path | None, level: float, suite: int) -> set[str]:
    """Ids of the cases that the file holds."""
    if path is None or not path.exists():
        return set()
    rows = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip())
    return {row["id"] for row in rows if row["level"] == level and row["seed"] == suite and "error" not in row}


def run(cases: Iterable[Case], settings: Settings, jobs: int, path: Path | None) -> None:
    """Run cases in worker processes and write a line for each."""
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    cases = list(cases)
    console = Console(stderr=True)
    output = path.open("a", encoding="utf-8") if path is not None else sys.stdout
    columns = (*Progress.get_default_columns()[:-1], MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, TextColumn("{task.fields[last]}"), console=console) as progress:
        task = progress.add_task("cases", total=len(cases), last="")

        def take(row: dict[str, Any]) -> None:
            output.write(json.dumps(row) + "\n")
            output.flush()
            progress.update(task, advance=1, last=row["id"] + (" failed" if "error" in row else ""))

        if jobs == 1:
            for case in cases:
                take(attempt(case, settings))
        else:
            context = multiprocessing.get_context("spawn")
            # Fresh workers every so often: compiled code and figures pile up in a process.
            for first in range(0, len(cases), _BATCH):
                cores = context.Queue()
                for core in range(jobs):
                    cores.put(core)
                with ProcessPoolExecutor(jobs, context, _keep_to_one_core, (cores,)) as pool:
                    for job in as_completed(
                        [pool.submit(attempt, case, settings) for case in cases[first : first + _BATCH]]
                    ):
                        take(job.result())
    if path is not None:
        output.close()


def main() -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, help="about so many cases, shared out among the categories (default: all)")
    parser.add_argument(
        "--only", action="append", default=[], metavar="PATTERN", help="ids such as 'single/dead_zone/*'"
    )
    parser.add_argument("--category", action="append", default=[], choices=CATEGORIES)
    parser.add_argument("--level", type=float, default=0.01, help="family-wise error rate (default 0.01)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the whole suite (default 1)")
    parser.add_argument("--jobs", type=int, default=2, help="worker processes (default 2)")
    parser.add_argument("--resume", type=Path, metavar="FILE", help="add lines to this file, leave out what it holds")
    parser.add_argument(
        "--quick", action="store_true", help="leave out what needs fits of the true model: testability, error ratio"
    )
    parser.add_argument("--resolve", action="store_true", help="run the suggested experiment of untestable cases")
    parser.add_argument(
        "--simulator", choices=("idloop", "mujoco", "equations"), help="another one than the case's own"
    )
    parser.add_argument("--limit", type=float, default=1200.0, help="processor seconds after which a case is given up")
    arguments = parser.parse_args()
    settings = Settings(arguments.seed, arguments.level, not arguments.quick, arguments.resolve, arguments.limit)
    cases = chosen(arguments.only, arguments.category, arguments.cases)
    if arguments.simulator:
        cases = [replace(case, simulator=arguments.simulator) for case in cases]
    known = done_already(arguments.resume, arguments.level, arguments.seed)
    left = [case for case in cases if case.id not in known]
    print(f"{len(cases)} cases, {len(left)} to run", file=sys.stderr)
    run(left, settings, arguments.jobs, arguments.resume)
    return 0


if __name__ == "__main__":
    sys.exit(main())
