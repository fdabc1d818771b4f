"""Does an effect of the size that the gate states show, and one far below it not? Simulated, with counts.

    python benchmarks/diagnosis/limits.py --cases 60 --resume limits.jsonl

On each clean case of a one-body machine the diagnosis states from which size on an effect would show. The
same machine, with other noise, then hides one effect at a tenth of that size, at the size, and at twice it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from case import Case, Hidden
from experiment import experiment
from intervals import clopper_pearson
from score import Rung, score

MACHINES = ("axis", "dc_motor", "axis_position", "dc_position")
FACTORS = (0.1, 1.0, 2.0)
# Other parameters of the effects that have some.
BESIDE = {
    "imbalance": {"phase": 0.6},
    "cogging": {"harmonic": 6.0, "phase": 0.6},
    "cable_spring": {"rest": 0.0},
    "compliance": {"damping": 0.05, "split": 0.5},
}
EFFECTS = (
    *("coulomb_friction", "dead_zone", "backlash", "imbalance", "cogging", "cable_spring", "compliance"),
    *("input_delay", "actuator_lag", "gain_asymmetry", "quadratic_drag", "velocity_filter"),
)


def limited(case: Case, suite: int, level: float) -> list[dict[str, Any]]:
    """Diagnose one clean case, and the machine with an effect of each size; a row for each size."""
    from idloop.diagnosis import diagnose

    data = experiment(case, suite)
    clean = diagnose(data.start, data.training, level=level, seed=suite)
    limits = {
        name: limit
        for name, limit in clean.gate.limits.items()
        if name.split("@")[0] in EFFECTS and np.isfinite(limit.sure) and limit.sure < 2.0 * limit.least
    }
    if clean.set or not limits:
        return []
    names = sorted(limits)
    name = names[case.seed(suite, "effect") % len(names)]
    limit, (effect, at) = limits[name], name.split("@")
    rows = []
    for factor in FACTORS:
        size = limit.sure / factor if limit.at_most else limit.sure * factor
        hidden = Hidden(effect, at, {limit.parameter: size, **BESIDE.get(effect, {})})
        other = replace(case, id=f"{case.id}/{name}/{factor:g}", category="single", hidden=(hidden,))
        row = {"id": case.id, "effect": name, "factor": factor, "size": size}
        try:
            data = experiment(other, suite)
            found = diagnose(data.start, data.training, level=level, seed=suite)
        except Exception as error:  # noqa: BLE001 (a case that fails is a result)
            rows.append({**row, "error": f"{type(error).__name__}: {error}"})
            continue
        added = [Rung(r.added.name, r.set, r.added.replaces, r.added.p_value, r.added.gain) for r in found.rungs]
        rows.append({**row, "set": list(found.set), "found": all(score(other, data.start, added).found)})
    return rows


def report(rows: list[dict[str, Any]]) -> None:
    """Print shares found by size."""
    for factor in FACTORS:
        ended = [row for row in rows if row["factor"] == factor and "error" not in row]
        for text, hits in (
            ("the effect found", [row["found"] for row in ended]),
            ("anything found", [bool(row["set"]) for row in ended]),
        ):
            low, high = clopper_pearson(sum(hits), len(hits))
            print(f"{factor:5g} times the stated size: {text:18} {sum(hits):4}/{len(hits)} ({low:.3f} .. {high:.3f})")
    for row in rows:
        if "error" in row or (row["factor"] > 1.0 and not row["found"]):
            print(json.dumps(row))


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=60, help="clean cases (default 60)")
    parser.add_argument("--level", type=float, default=0.01)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--resume", type=Path, metavar="FILE", help="write here, and leave out what it holds")
    arguments = parser.parse_args()
    from cases import cases_of

    cases = [case for case in cases_of(lambda case_id: case_id.startswith("clean/")) if case.machine in MACHINES]
    cases = cases[: arguments.cases]
    rows: list[dict[str, Any]] = []
    if arguments.resume is not None and arguments.resume.exists():
        rows = [json.loads(line) for line in arguments.resume.read_text(encoding="utf-8").splitlines()]
    done = {row["id"] for row in rows}
    with ProcessPoolExecutor(arguments.jobs) as pool:
        waiting = [pool.submit(limited, case, arguments.seed, arguments.level) for case in cases if case.id not in done]
        for future in as_completed(waiting):
            rows += future.result()
            if arguments.resume is not None:
                with arguments.resume.open("a", encoding="utf-8") as file:
                    file.writelines(json.dumps(row) + "\n" for row in future.result())
    report(rows)


if __name__ == "__main__":
    main()
