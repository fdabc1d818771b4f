"""How often do the 95 % intervals of a fit contain the truth? Counted, not assumed.

Simulates a DC motor with Coulomb friction (preset `dc_motor`, 100 Hz, position and
velocity measured) many times, in open loop and under a P and a PD controller, with
white noise, with coloured noise (first-order autoregression, pole 0.9) and with a
disturbance torque; fits it each time from wrong starting values and counts for
every parameter how many intervals hold. `gain` is estimated with the inertia known,
`inertia` with the gain known; the two cannot be told apart from one another. With `--unknown both` everything is
free, and it is the intervals of the ratios to the inertia that are counted.

    python benchmarks/interval_coverage.py                  # 200 fits a case, all cases
    python benchmarks/interval_coverage.py --fits 50 --loop open --noise ar
    python benchmarks/interval_coverage.py --unknown both   # ratios
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

# Two workers share the cores already: threads inside the linear algebra only get in their way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SAMPLE_TIME = 0.01
COULOMB = 0.8
LOOPS = ("open", "p", "pd")
NOISES = ("white", "ar", "torque")
UNKNOWN, RATIOS = ("gain", "inertia"), "both"


@dataclass(frozen=True)
class Case:
    """One cell of the table: loop, noise, which of gain and inertia is estimated."""

    loop: str
    noise: str
    unknown: str


def excitation(loop: str, samples: int, rng: np.random.Generator) -> Array:
    """Random levels: of the command in open loop, of the position reference in closed loop."""
    hold = 40 if loop == "open" else 80
    span = 3.0 if loop == "open" else 6.0
    return np.repeat(rng.uniform(-span, span, samples // hold + 1), hold)[:samples]


def coloured(kind: str, samples: int, std: Array, rng: np.random.Generator) -> Array:
    """Measurement noise with the given standard deviations."""
    white = rng.normal(size=(samples, len(std)))
    if kind == "ar":
        from scipy.signal import lfilter

        # Started in its stationary distribution, unit variance.
        white[0] /= np.sqrt(1.0 - 0.9**2)
        white = lfilter([1.0], [1.0, -0.9], white, axis=0) * np.sqrt(1.0 - 0.9**2)
    return np.asarray(white * std)


def experiment(case: Case, samples: int, seed: int) -> tuple[Any, Any]:
    """Simulate one experiment; returns the true model and the record."""
    from idloop.physics import Plant, load_model
    from idloop.records import record_from_model

    rng = np.random.default_rng(seed)
    model = load_model("dc_motor").with_effects([f"coulomb_friction@motor(level={COULOMB})"])
    std = np.array([output.noise for output in model.outputs], dtype=float)
    # A torque of 5 % of the typical drive, changing within a second.
    torque = 0.6 if case.noise == "torque" else 0.0
    plant = Plant(model, seed=seed, noise=False, disturbance_std=torque, disturbance_time_constant=1.0)
    signal = excitation(case.loop, samples, rng)
    noise = coloured(case.noise, samples, std, rng)
    time_ = np.asarray(np.arange(samples) * SAMPLE_TIME, dtype=np.float64)
    command = np.empty(samples)
    output = np.empty((samples, 2))
    for k in range(samples):
        output[k] = plant.measure() + noise[k]
        if case.loop == "open":
            command[k] = signal[k]
        else:
            damping = 0.15 if case.loop == "pd" else 0.0
            wanted = 1.5 * (signal[k] - output[k, 0]) - damping * output[k, 1]
            command[k] = np.clip(wanted, -10.0, 10.0)
        plant.step(command[k], time_[k] + SAMPLE_TIME)
    reference = None if case.loop == "open" else np.column_stack([signal, np.full(samples, np.nan)])
    name = f"{case.loop}-{case.noise}-{seed}"
    return model, record_from_model(name, model, time_, command, output, reference)


def trial(case: Case, samples: int, seed: int, criterion: str) -> dict[str, Any]:
    """One simulated fit: estimate, standard error and truth of every parameter."""
    from idloop.estimation import fit

    truth, record = experiment(case, samples, seed)
    scales = {"gain": ("drive.gain",), "inertia": ("motor.inertia",), RATIOS: ("drive.gain", "motor.inertia")}
    scale, rest = scales[case.unknown], ("motor.viscous_friction", "coulomb_friction@motor.level")
    wrong = {**{name: 0.6 * truth.values[name] for name in scale}, rest[0]: 1.0, rest[1]: 0.2}
    result = fit(truth.with_free((*scale, *rest)).with_values(wrong), [record], criterion=criterion)
    told = [
        (name, *row, truth.values[name]) for name, *row in zip(result.names, result.values, result.stderr, strict=True)
    ]
    if case.unknown == RATIOS:
        told = [(one.name, one.value, one.stderr, true_ratio(truth, one.name)) for one in result.ratios]
    return {
        "parameters": {name: [float(number) for number in row] for name, *row in told},
        "criterion": result.criterion,
        "converged": result.converged,
    }


def true_ratio(truth: Any, name: str) -> float:
    """The ratio that an estimate is named after: "first / second"."""
    first, second = name.split(" / ")
    return float(truth.values[first] / truth.values[second])


def binomial_interval(hits: int, count: int) -> tuple[float, float]:
    """95 % interval of a proportion (Wilson, JASA 22, 1927)."""
    z = 1.959963984540054
    share = hits / count
    centre = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z * np.sqrt(share * (1 - share) / count + z * z / (4 * count**2)) / (1 + z * z / count)
    return float(centre - half), float(centre + half)


def run(
    cases: list[Case], fits: int, samples: int, seed: int, criterion: str, workers: int
) -> Iterator[tuple[Case, dict[str, Any]]]:
    """Run all trials; the answers do not depend on the number of workers."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        jobs = {
            pool.submit(trial, case, samples, seed + 1000 * number + index, criterion): case
            for number, case in enumerate(cases)
            for index in range(fits)
        }
        for job in as_completed(jobs):
            yield jobs[job], job.result()


def table(results: dict[Case, list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Coverage of every parameter in every case."""
    rows = []
    for case, trials in results.items():
        for name in trials[0]["parameters"]:
            value, stderr, truth = np.array([t["parameters"][name] for t in trials]).T
            hits = int(np.sum(np.abs(value - truth) <= 1.959963984540054 * stderr))
            low, high = binomial_interval(hits, len(trials))
            rows.append(
                {
                    "loop": case.loop,
                    "noise": case.noise,
                    "parameter": name,
                    "unknown": case.unknown,
                    "hits": hits,
                    "fits": len(trials),
                    "coverage": hits / len(trials),
                    "interval": [low, high],
                    "bias_in_stderr": float(np.mean(value - truth) / np.std(value)),
                    "stderr_ratio": float(np.sqrt(np.mean(stderr**2)) / np.std(value)),
                    "spread_percent": float(100 * np.std(value) / truth[0]),
                    "criteria": sorted({t["criterion"] for t in trials}),
                    "not_converged": sum(not t["converged"] for t in trials),
                }
            )
    return rows


def main() -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fits", type=int, default=200, help="fits per case")
    parser.add_argument("--samples", type=int, default=2000, help="samples per record")
    parser.add_argument("--seed", type=int, default=1, help="seed of the whole table")
    parser.add_argument("--loop", choices=LOOPS, action="append", help="only this loop (repeatable)")
    parser.add_argument("--noise", choices=NOISES, action="append", help="only this noise (repeatable)")
    parser.add_argument("--unknown", choices=(*UNKNOWN, RATIOS), action="append", help="only this unknown (repeatable)")
    parser.add_argument("--criterion", default="auto", help="criterion of the fit")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    arguments = parser.parse_args()
    cases = [
        Case(loop, noise, unknown)
        for loop in arguments.loop or LOOPS
        for noise in arguments.noise or NOISES
        for unknown in arguments.unknown or UNKNOWN
    ]
    from rich.console import Console
    from rich.progress import Progress

    results: dict[Case, list[dict[str, Any]]] = {case: [] for case in cases}
    begin = time.monotonic()
    with Progress(console=Console(stderr=True), disable=not sys.stderr.isatty()) as progress:
        task = progress.add_task("fits", total=len(cases) * arguments.fits)
        for case, answer in run(
            cases, arguments.fits, arguments.samples, arguments.seed, arguments.criterion, arguments.workers
        ):
            results[case].append(answer)
            progress.advance(task)
    rows = table(results)
    if arguments.json:
        print(json.dumps({"seed": arguments.seed, "samples": arguments.samples, "rows": rows}, indent=1))
        return 0
    width = max(30, *(len(row["parameter"]) for row in rows))
    print(
        f"{'loop':5} {'noise':7} {'parameter':{width}} {'held':>9} "
        f"{'coverage, 95 % interval':>27} {'bias/sd':>8} {'se/sd':>6} {'sd %':>6}  criterion"
    )
    for row in rows:
        low, high = row["interval"]
        print(
            f"{row['loop']:5} {row['noise']:7} {row['parameter']:{width}} {row['hits']:4}/{row['fits']:<4} "
            f"{100 * row['coverage']:9.1f} % ({100 * low:4.1f} .. {100 * high:5.1f}) "
            f"{row['bias_in_stderr']:8.2f} {row['stderr_ratio']:6.2f} {row['spread_percent']:6.2f}  "
            f"{','.join(row['criteria'])}" + (f"  {row['not_converged']} not settled" if row["not_converged"] else "")
        )
    outside = [r for r in rows if not 0.92 <= r["coverage"] <= 0.98]
    print(f"{len(rows) - len(outside)} of {len(rows)} coverages lie in 92 .. 98 %; {time.monotonic() - begin:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
