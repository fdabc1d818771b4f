"""Is a coefficient that is not constant told as such, and none where all are constant? Simulated, with counts.

    python benchmarks/diagnosis/coefficients.py --machines 60

Each machine is diagnosed from a plain model a third off, by the whole catalogue. Where a coefficient changes, nothing
of the catalogue is missing: an effect that is named is a false one.
"""

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from changing_machines import CHANGING, changing, constant, recorded
from intervals import clopper_pearson

PARTS = (0.1, 0.25, 0.4)
COLOURED = 3.0


def answer(job: tuple[str, float, int]) -> tuple[str, str]:
    """Diagnose one machine: what was said of it, and the effect that was named, if one was."""
    from idloop.diagnosis import diagnose
    from idloop.physics import load_model

    kind, part, seed = job
    model = load_model("axis")
    start = model.with_values({p.name: 0.7 * p.value for p in model.parameters if p.free})
    if kind in CHANGING:
        record = recorded(changing(kind, part), seed, seconds=30.0 if "time" in kind else 15.0)
    else:
        record = recorded(constant, seed, coloured=part)
    with np.errstate(all="ignore"):
        found = diagnose(start, [record], seed=seed)
    if found.unknown is not None:
        return f"{found.unknown.of} over {found.unknown.variable}", ""
    return found.verdict, found.set[0] if found.set else ""


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=20, help="machines of each kind (default 20)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    kinds = [(kind, part) for kind in CHANGING for part in PARTS] + [("constant", 0.0), ("constant", COLOURED)]
    jobs = [(kind, part, seed) for kind, part in kinds for seed in range(arguments.machines)]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        answers = dict(zip(jobs, pool.map(answer, jobs), strict=True))
    for kind, part in kinds:
        told = [answers[kind, part, seed] for seed in range(arguments.machines)]
        named = sum(bool(effect) for _, effect in told)
        if kind in CHANGING:
            _, of, over = CHANGING[kind]
            right, what = sum(said == f"{of} over {over}" for said, _ in told), f"{kind}, {100 * part:.0f} %"
        else:
            right, what = sum(said == "adequate" for said, _ in told), "constant" + (", coloured noise" if part else "")
        low, high = clopper_pearson(right, len(told))
        print(f"{what:32} told right {right:3}/{len(told)} ({low:.2f} .. {high:.2f}), an effect named {named}")


if __name__ == "__main__":
    main()
