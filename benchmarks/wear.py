"""Does the monitor keep its promises? False alarms and detection delays, counted.

Many machines are simulated, each with noise and disturbances of its own. Each is fitted on a record of a minute or
two, its monitor learns from a healthy reference of twenty minutes, and then watches the healthy machine for hours
(false alarms) and the machine after a sudden growth (delay). The viscous friction wanders by ± 10 % all the
while, as it does with the temperature: that is no wear.

Machines: `friction`, a DC motor (preset `dc_motor`, 100 Hz) whose Coulomb friction grows; `backlash`, a motor and a
load behind an elastic coupling under a PD controller, seen by the motor's encoder alone (200 Hz), whose gap grows.
Noise: `white`; `coloured`, first-order autoregression with pole 0.9; both with a disturbance torque that changes in
about a second.

    python benchmarks/wear.py                                   # 40 machines a case, 5 h each
    python benchmarks/wear.py --machines 10 --hours 2 --case friction --noise coloured
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

# Two workers share the cores already: threads inside the linear algebra only get in their way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from interval_coverage import binomial_interval, coloured
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATES = (2.0, 20.0, 1000.0)  # hours between two false alarms
GROWTHS = (1.0, 2.0)  # in units of the watched growth
REFERENCE = 1200.0  # [s]
PIECE = 600.0  # longest record [s]
HEALTHY_BEFORE = 120.0  # [s]
WORN = 1200.0  # seconds after which a growth counts as missed
VISCOUS = 0.1

TWO_BODIES = """
schema: idloop/model/1
name: two_bodies
input: {topic: joint_command, joint: motor, field: effort, unit: N·m}
outputs:
  - {topic: joint_states, joint: motor, field: position, unit: rad, noise: 0.01}
bodies:
  - {name: motor, inertia: {value: 0.01, min: 0.0}, viscous_friction: {value: 0.05, min: 0.0}}
  - {name: load, inertia: {value: 0.02, min: 0.0}, viscous_friction: {value: 0.02, min: 0.0}}
couplings:
  - {from: motor, to: load, stiffness: {value: 10.0, min: 0.0}, damping: {value: 0.05, min: 0.0}}
drive: {gain: 1.0}
effects:
  - {effect: backlash, at: motor-load, gap: {value: 0.05, min: 0.0}}
controller: {type: pd, output: motor.position, kp: 3.0, kd: 0.3, limit: 10.0, sample_time: 0.005}
"""


@dataclass(frozen=True)
class Case:
    """What grows, under which noise."""

    name: str
    noise: str


@dataclass(frozen=True)
class Setting:
    """A machine, how it is driven, what is free in the fit and what is watched."""

    model: Any
    sample_time: float
    level: float
    hold: int
    torque: float
    free: tuple[str, ...]
    watch: str


def setting(name: str) -> Setting:
    """One of the two machines."""
    from idloop.physics import load_model
    from idloop.physics.model_file import from_text

    if name == "friction":
        model = load_model("dc_motor").with_effects(["coulomb_friction@motor(level=0.8)"])
        names = ("drive.gain", "motor.viscous_friction", "coulomb_friction@motor.level")
        return Setting(model, 0.01, 3.0, 40, 0.6, names, names[2])
    model = from_text(TWO_BODIES, None)
    names = (
        "motor.inertia",
        "motor.viscous_friction",
        "load.inertia",
        "motor-load.stiffness",
        "backlash@motor-load.gap",
    )
    return Setting(model, 0.005, 0.5, 100, 0.05, names, names[4])


def record(case: Case, made: Setting, model: Any, seconds: float, seed: int) -> Any:
    """A machine in motion for some time, from rest."""
    from idloop.control import build_controller
    from idloop.diagnosis.design.experiment_loop import simulate_closed_loop
    from idloop.physics import Engine
    from idloop.records import record_from_model

    rng = np.random.default_rng(seed)
    count = round(seconds / made.sample_time)
    time = np.asarray(np.arange(count) * made.sample_time, dtype=np.float64)
    level = np.repeat(rng.uniform(-made.level, made.level, count // made.hold + 1), made.hold)[:count]
    closed = case.name == "backlash"
    section = model.controller if closed else {"type": "none", "sample_time": made.sample_time}
    kernel = build_controller(section).kernel
    std = np.array([output.noise for output in model.outputs], dtype=float)
    reference = np.column_stack([level if closed else np.zeros(count), np.zeros(count)])
    engine = Engine(model)
    output, command = simulate_closed_loop(
        engine,
        None,
        kernel,
        np.array([model.output_names.index(name) for name in kernel.inputs], dtype=np.int64),
        time,
        np.ones(count, dtype=bool),
        reference,
        np.zeros(count) if closed else level,
        engine.initial_state(),
        coloured("ar" if case.noise == "coloured" else "white", count, std, rng),
        made.torque * slow(count, made.sample_time, rng),
    )
    name = f"{case.name}-{case.noise}-{seed}"
    return record_from_model(name, model, time, command, output, reference if closed else None)


def slow(count: int, sample_time: float, rng: np.random.Generator) -> Array:
    """First-order process of unit variance that changes in about a second, shape (n,)."""
    from scipy.signal import lfilter

    pole = np.exp(-sample_time)
    white = np.sqrt(1.0 - pole**2) * rng.standard_normal(count)
    white[0] = rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -pole], white))


def warmed(made: Setting, rng: np.random.Generator, growth: float = 0.0) -> Any:
    """The machine at some temperature, worn by so much [unit]."""
    model = made.model
    factor = 1.0 + rng.uniform(-VISCOUS, VISCOUS)
    values = {name: factor * value for name, value in model.values.items() if name.endswith(".viscous_friction")}
    return model.with_values({**values, made.watch: model.values[made.watch] + growth})


def trial(case: Case, hours: float, worn: int, seed: int, share: float) -> dict[str, Any]:
    """One machine: fit, reference, hours of health, and some growths."""
    from idloop.estimation import fit
    from idloop.monitoring import Monitor, choose_watches, learn

    made, rng = setting(case.name), np.random.default_rng(seed)

    def move(seconds: float, growth: float = 0.0) -> Any:
        return record(case, made, warmed(made, rng, growth), seconds, int(rng.integers(2**31)))

    fitted = fit(made.model.with_free(made.free), [move(120.0)], criterion="prediction").model
    watches = choose_watches(fitted, [f"{made.watch}={share:g}%"])
    pieces = round(REFERENCE / PIECE)
    reference = [move(REFERENCE / pieces) for _ in range(pieces)]
    any_base = learn(fitted, reference, watches)
    bases = {rate: any_base.with_false_alarm_hours(rate) for rate in RATES}
    growth = watches[0].growth
    healthy = [any_base.scores(move(PIECE)) for _ in range(round(3600.0 * hours / PIECE))]
    found: dict[str, Any] = {
        "rates": {},
        "seed": seed,
        "spread": any_base.normal[0].variance_ratio,
        "echo": any_base.normal[0].sensitivity,
    }
    found["block"], found["hours"] = any_base.block, sum(len(s) for s in healthy) * any_base.block / 3600.0
    before = [any_base.scores(move(HEALTHY_BEFORE)) for _ in range(worn)]
    after = {g: [any_base.scores(move(WORN, g * growth)) for _ in range(worn)] for g in GROWTHS}
    for rate, base in bases.items():
        monitor = Monitor(base)
        for scores in healthy:
            monitor.begin()
            monitor.take(scores)
        row: dict[str, Any] = {"alarms": len(monitor.sums[0].alarms), "why": base.normal[0].why}
        row["threshold"] = base.normal[0].threshold
        row["promised"] = {g: base.delay(0, growth=g) for g in GROWTHS}
        row["delays"] = {g: [] for g in GROWTHS}
        row["held"] = {g: [] for g in GROWTHS}
        for g in GROWTHS:
            for first, then in zip(before, after[g], strict=True):
                monitor = Monitor(base)
                monitor.take(first)
                monitor.sums[0].alarms.clear()
                monitor.begin()
                monitor.take(then)
                alarms = monitor.sums[0].alarms
                start = int(then.index[0])
                row["delays"][g].append(None if not alarms else (alarms[0].block + 1 - start) * base.block)
                now = monitor.states()[0].growth
                if alarms and now is not None:
                    at = alarms[0].growth
                    row["held"][g].append([at.low <= g * growth <= at.high, now.low <= g * growth <= now.high])
        found["rates"][rate] = row
    return found


def poisson_interval(count: int) -> tuple[float, float]:
    """95 % interval of a Poisson mean (Garwood, Biometrika 28, 1936)."""
    from scipy.stats import chi2

    low = 0.0 if count == 0 else 0.5 * float(chi2.ppf(0.025, 2 * count))
    return low, 0.5 * float(chi2.ppf(0.975, 2 * count + 2))


def mean_interval(values: list[float]) -> tuple[float, float, float]:
    """Mean and its 95 % interval."""
    mean, error = float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values)))
    return mean, mean - 1.96 * error, mean + 1.96 * error


def print_rows(case: Case, trials: list[dict[str, Any]]) -> None:
    """What was promised and what came of it."""
    hours = sum(t["hours"] for t in trials)
    spread, echo = (float(np.median([t[name] for t in trials])) for name in ("spread", "echo"))
    print(f"{case.name}, {case.noise} noise: {len(trials)} machines, {hours:.0f} h healthy")
    print(f"  medians: spread {spread:.2f}, echo {echo:.2f}")
    for rate in RATES:
        rows = [t["rates"][rate] for t in trials]
        able = [(t, row) for t, row in zip(trials, rows, strict=True) if not row["why"]]
        if not able:
            print(f"  1 in {rate:g} h: cannot tell; {rows[0]['why']}")
            continue
        ran = sum(t["hours"] for t, _ in able)
        alarms = sum(row["alarms"] for _, row in able)
        low, high = poisson_interval(alarms)
        print(
            f"  1 in {rate:g} h ({len(able)} of {len(rows)} references long enough): {alarms} false alarms in "
            f"{ran:.0f} h, promised {ran / rate:.1f}, 95 % {low:.1f} .. {high:.1f}"
        )
        for g in GROWTHS:
            delays = [d for _, row in able for d in row["delays"][g]]
            seen = [d for d in delays if d is not None]
            promised = float(np.mean([row["promised"][g] for _, row in able]))
            if len(seen) < 2:
                print(f"    growth x {g:g}: {len(seen)} of {len(delays)} noticed within {WORN:g} s")
                continue
            mean, least, most = mean_interval(seen)
            held = np.array([one for _, row in able for one in row["held"][g]], dtype=bool)
            at, now = (
                f"{int(h.sum())}/{len(h)} ({100 * lo:.0f} .. {100 * hi:.0f} %)"
                for h in held.T
                for lo, hi in [binomial_interval(int(h.sum()), len(h))]
            )
            print(
                f"    growth x {g:g}: {len(seen)} of {len(delays)} noticed, delay {mean:.1f} s, 95 % {least:.1f} .. "
                f"{most:.1f}, promised {promised:.1f} s; intervals that hold: at the alarm {at}, newest {now}"
            )


def main() -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=40, help="machines per case")
    parser.add_argument("--hours", type=float, default=5.0, help="healthy hours of each machine")
    parser.add_argument("--worn", type=int, default=3, help="sudden growths of each machine and size")
    parser.add_argument("--growth", type=float, default=20.0, help="watched growth in percent")
    parser.add_argument("--case", choices=("friction", "backlash"), action="append", help="only this (repeatable)")
    parser.add_argument("--noise", choices=("white", "coloured"), action="append", help="only this (repeatable)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the whole table")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    arguments = parser.parse_args()
    cases = [
        Case(c, n) for c in arguments.case or ("friction", "backlash") for n in arguments.noise or ("white", "coloured")
    ]
    from rich.console import Console
    from rich.progress import Progress

    results: dict[Case, list[dict[str, Any]]] = {case: [] for case in cases}
    context = multiprocessing.get_context("spawn")
    with (
        Progress(console=Console(stderr=True), disable=not sys.stderr.isatty()) as progress,
        ProcessPoolExecutor(arguments.workers, mp_context=context) as pool,
    ):
        task = progress.add_task("machines", total=len(cases) * arguments.machines)
        jobs = {
            pool.submit(
                trial,
                case,
                arguments.hours,
                arguments.worn,
                100_000 * arguments.seed + 1000 * number + k,
                arguments.growth,
            ): case
            for number, case in enumerate(cases)
            for k in range(arguments.machines)
        }
        for job in as_completed(jobs):
            results[jobs[job]].append(job.result())
            progress.advance(task)
    for trials in results.values():
        trials.sort(key=lambda t: t["seed"])  # as_completed has no order; the answer must have one
    if arguments.json:
        rows = [{"case": case.name, "noise": case.noise, "machines": trials} for case, trials in results.items()]
        print(json.dumps({"seed": arguments.seed, "growth": arguments.growth, "cases": rows}, indent=1))
        return 0
    for case, trials in results.items():
        print_rows(case, trials)
    return 0


if __name__ == "__main__":
    sys.exit(main())
