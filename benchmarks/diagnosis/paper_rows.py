"""Rows of the source papers that linear models could not carry, over seeds, disturbances and simulators.

    python benchmarks/diagnosis/paper_rows.py                            # all rows
    python benchmarks/diagnosis/paper_rows.py --row A6 --seeds 1 2 3     # DC motor, four amplitudes
    python benchmarks/diagnosis/paper_rows.py --row B2 --case slip all   # torsion system under PID
    python benchmarks/diagnosis/paper_rows.py --row B9 --figures out --json out/rows.json

A6 is Rungroungdouyboon (Lehigh 1999), B2 and B9 the Linköping thesis of 2009 (Quanser torsion system). The rows
themselves are in `papers`, and ``idloop papers`` runs them once on machines of its own; here the machines are
those of this suite's simulators.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from paper_records import plain_numbers, simulated_by
from simulators import SIMULATORS

from idloop.reporting.text.blocks import as_text
from papers import Progress
from papers.motor import drifting_fits
from papers.reproduction import Reproduction
from papers.torsion import torsion_amplitudes, torsion_effects

ROWS = ("A6", "B2", "B9")


@contextmanager
def bar(jobs: int) -> Iterator[Callable[[int], Progress]]:
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

        def part(number: int) -> Callable[[float, str], None]:
            return lambda share, text: bars.update(task, completed=number + share, description=text)

        yield part


def jobs(arguments: argparse.Namespace) -> list[tuple[str, Callable[[Progress], Reproduction]]]:
    """What is to be run, in order: the row and a function of the progress."""
    simulate, level = simulated_by(arguments.simulator), arguments.level
    shares = [percent / 100.0 for percent in arguments.disturbance]

    def motor(name: str, seed: int) -> Callable[[Progress], Reproduction]:
        return lambda tell: drifting_fits.DriftingFits((drifting_fits.motor_fits(name, seed, tell, simulate, level),))

    def effects(name: str, seed: int, share: float) -> Callable[[Progress], Reproduction]:
        return lambda tell: torsion_effects.TorsionEffects(
            (torsion_effects.torsion_case(name, seed, tell, share, simulate, level),)
        )

    def amplitudes(seed: int, share: float) -> Callable[[Progress], Reproduction]:
        return lambda tell: torsion_amplitudes.reproduce(seed, tell, share, simulate, level)

    found: list[tuple[str, Callable[[Progress], Reproduction]]] = []
    for seed in arguments.seeds:
        if "A6" in arguments.row:
            found += [("A6", motor(name, seed)) for name in drifting_fits.FRICTION]
        if "B2" in arguments.row:
            found += [("B2", effects(name, seed, share)) for name in arguments.case for share in shares]
        if "B9" in arguments.row:
            found += [("B9", amplitudes(seed, share)) for share in shares]
    return sorted(found, key=lambda job: ROWS.index(job[0]))


def motor_count(results: Sequence[Any]) -> str:
    """How often the answer was right, over the seeds."""
    lines = [""]
    for name in drifting_fits.FRICTION:
        several = [one for result in results for one in result.machines if one.name == name]
        right = sum(one.found.right for one in several)
        lines.append(f"A6  {name}: all found and nothing else in {right} of {len(several)} seeds")
    return "\n".join(lines)


def effects_count(results: Sequence[Any]) -> str:
    """One line for each case, and the count."""
    cases = [case for result in results for case in result.cases]
    lines = [
        f"B2  {case.title}, seed {case.seed}: {'right' if case.found.right else 'WRONG'}, {case.found.words};"
        f" largest error {case.found.farthest:.1f} standard errors; {case.found.seconds:.0f} s"
        for case in cases
    ]
    return "\n".join(["", *lines, f"  {sum(case.found.right for case in cases)} of {len(cases)} answers right"])


COUNTS: dict[str, Callable[[Sequence[Any]], str]] = {"A6": motor_count, "B2": effects_count}


def draw(row: str, results: Sequence[Any], path: Path) -> None:
    """Write the figure of a row: of B2 all cases in one, of the others one for each run."""
    import matplotlib as mpl

    mpl.use("Agg")
    from idloop.drawing import save

    if row == "B2":
        cases = [case for result in results for case in result.cases]
        save(torsion_effects.draw_cases(cases)[0].figure, path)
        return
    for number, result in enumerate(results, 1):
        axes: Any = result.plot()
        each = path if len(results) == 1 else path.with_stem(f"{path.stem}_{number}")
        save(axes.flat[0].figure, each)


def parsed(given: list[str] | None) -> argparse.Namespace:
    """Read the command line."""
    cases = list(torsion_effects.CASES)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--row", nargs="+", choices=ROWS, default=list(ROWS), help="rows to run (default all)")
    parser.add_argument("--case", nargs="+", choices=cases, default=cases, help="cases of B2")
    parser.add_argument(
        "--disturbance", nargs="+", type=float, default=[1.0, 5.0], help="disturbance torque of B2 and B9 [%%]"
    )
    parser.add_argument("--seeds", nargs="+", type=int, default=[1], help="of noise, disturbance and start model")
    parser.add_argument("--simulator", choices=SIMULATORS, default="equations", help="(default equations)")
    parser.add_argument("--level", type=float, default=0.01, help="family-wise error rate (default 0.01)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers")
    parser.add_argument("--figures", type=Path, metavar="DIR", help="write the figures of every row")
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
            print(f"\n{row}: {'holds' if result.holds else 'DOES NOT HOLD'}\n")
            print(as_text(result.blocks()))
            if arguments.json:
                arguments.json.parent.mkdir(parents=True, exist_ok=True)
                arguments.json.write_text(_document(arguments, results))
    for row, count in COUNTS.items():
        if row in results:
            print(count(results[row]))
    if arguments.figures:
        arguments.figures.mkdir(parents=True, exist_ok=True)
        for row, several in results.items():
            draw(row, several, arguments.figures / f"{row.lower()}.png")
    return 0


def _document(arguments: argparse.Namespace, results: dict[str, list[Any]]) -> str:
    settings = {"simulator": arguments.simulator, "level": arguments.level, "seeds": arguments.seeds}
    rows = {row: [result.to_dict() for result in several] for row, several in results.items()}
    return json.dumps(plain_numbers({**settings, "rows": rows}), indent=1) + "\n"


if __name__ == "__main__":
    sys.exit(main())
