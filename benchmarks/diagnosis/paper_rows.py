"""Rows of the source papers that linear models could not carry, and what the diagnosis makes of them.

    python benchmarks/diagnosis/paper_rows.py                            # all rows
    python benchmarks/diagnosis/paper_rows.py --row A6 --seeds 1 2 3     # DC motor, four amplitudes
    python benchmarks/diagnosis/paper_rows.py --row B2 --case slip all   # torsion system under PID
    python benchmarks/diagnosis/paper_rows.py --row B9 --figures out --json out/rows.json

A6 is Rungroungdouyboon (Lehigh 1999), B2 and B9 the Linköping thesis of 2009 (Quanser torsion system).
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import paper_dc_motor
import paper_torsion
from paper_records import Tell, plain_numbers
from simulators import SIMULATORS

ROWS = ("A6", "B2", "B9")


@contextmanager
def bar(jobs: int) -> Iterator[Callable[[int], Tell]]:
    """A progress bar on stderr.

    Parameters
    ----------
    jobs : int
        Parts of equal length.

    Yields
    ------
    callable
        From the number of a part to what it tells its progress to.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("", total=float(jobs))

        def part(number: int) -> Tell:
            return lambda share, text: bars.update(task, completed=number + share, description=text)

        yield part


def jobs(arguments: argparse.Namespace) -> list[tuple[str, Callable[[Tell], Any]]]:
    """What is to be run, in order: the row and a function of the progress."""
    simulator, level = arguments.simulator, arguments.level
    shares = [percent / 100.0 for percent in arguments.disturbance]
    found: list[tuple[str, Callable[[Tell], Any]]] = []
    for seed in arguments.seeds:
        if "A6" in arguments.row:
            found += [
                ("A6", lambda tell, s=seed, f=friction: paper_dc_motor.a6(f, simulator, level, s, tell))
                for friction in paper_dc_motor.FRICTION
            ]
        if "B2" in arguments.row:
            found += [
                ("B2", lambda tell, s=seed, c=case, d=share: paper_torsion.b2(c, d, simulator, level, s, tell))
                for case in arguments.case
                for share in shares
            ]
        if "B9" in arguments.row:
            found += [
                ("B9", lambda tell, s=seed, d=share: paper_torsion.b9(d, simulator, level, s, tell)) for share in shares
            ]
    return sorted(found, key=lambda job: ROWS.index(job[0]))


WORDS: dict[str, Callable[[Any], str]] = {
    "A6": paper_dc_motor.text,
    "B2": paper_torsion.b2_text,
    "B9": paper_torsion.b9_text,
}
COUNTS: dict[str, Callable[[Any], str]] = {"A6": paper_dc_motor.counted, "B2": paper_torsion.b2_counted}


def parsed(given: list[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--row", nargs="+", choices=ROWS, default=list(ROWS), help="rows to run (default all)")
    parser.add_argument(
        "--case", nargs="+", choices=list(paper_torsion.CASES), default=list(paper_torsion.CASES), help="cases of B2"
    )
    parser.add_argument(
        "--disturbance", nargs="+", type=float, default=[1.0, 5.0], help="disturbance torque of B2 and B9 [%%]"
    )
    parser.add_argument("--seeds", nargs="+", type=int, default=[1], help="of noise, disturbance and start model")
    parser.add_argument("--simulator", choices=SIMULATORS, default="equations", help="(default equations)")
    parser.add_argument("--level", type=float, default=0.01, help="family-wise error rate (default 0.01)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers")
    parser.add_argument("--figures", type=Path, metavar="DIR", help="write a figure per row")
    return parser.parse_args(given)


def main(given: list[str] | None = None) -> int:
    """Run the rows that were asked for."""
    arguments = parsed(given)
    todo = jobs(arguments)
    results: dict[str, list[Any]] = {}
    with bar(len(todo)) as part:
        for number, (row, work) in enumerate(todo):
            result = work(part(number))
            results.setdefault(row, []).append(result)
            print(WORDS[row](result), flush=True)
            if arguments.json:
                arguments.json.parent.mkdir(parents=True, exist_ok=True)
                arguments.json.write_text(_document(arguments, results))
    for row, count in COUNTS.items():
        if row in results:
            print(count(results[row]))
    if arguments.figures:
        import paper_figures

        arguments.figures.mkdir(parents=True, exist_ok=True)
        for row, several in results.items():
            paper_figures.FIGURES[row](several, arguments.figures / f"{row.lower()}.png")
    return 0


def _document(arguments: argparse.Namespace, results: dict[str, list[Any]]) -> str:
    settings = {"simulator": arguments.simulator, "level": arguments.level, "seeds": arguments.seeds}
    rows = {row: [result.to_dict() for result in several] for row, several in results.items()}
    return json.dumps(plain_numbers({**settings, "rows": rows}), indent=1) + "\n"


if __name__ == "__main__":
    sys.exit(main())
