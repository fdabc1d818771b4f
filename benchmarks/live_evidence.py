"""Does the live evidence keep its promise? Clean machines looked at many times each, false alarms counted.

Simulated machines that lack nothing are looked at every two seconds, as the live estimator does, and each run counts as
a false alarm where the evidence for any effect reached its threshold at any look. Machine: one rotary body whose
position and velocity are measured (preset `axis`, 100 Hz) under random steps of the command.

Cases: `white`, sensor noise alone; `coloured`, sensor noise and a disturbance torque of 2 % of the command with a
correlation time of 0.1 s; `louder`, the command becomes three times as large in the middle, so that what was fitted
before has to foretell another motion.

    python benchmarks/live_evidence.py                      # 200 runs a case, 10 looks each
    python benchmarks/live_evidence.py --runs 50 --case white --effects coulomb_friction dead_zone
"""

from __future__ import annotations

import argparse
import os
import sys
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from interval_coverage import binomial_interval

from idloop.diagnosis.evidence.live_evidence import LiveEvidence
from idloop.physics import load_model
from idloop.physics.simulation import simulate
from idloop.records import Record
from idloop.records.from_model import record_from_model

LEVELS = (0.01, 0.05, 0.2)
CASES = ("white", "coloured", "louder")
STEP, FIRST, PERIOD, MEMORY = 0.01, 6.0, 2.0, 20.0  # [s]
HOLD = 0.25  # of a command [s]
TORQUE, POLE = 0.02, 0.9  # disturbance: part of the command's deviation, and its memory
# The plain ones, as many as the time allows.
EFFECTS = ("coulomb_friction", "dead_zone", "gain_asymmetry", "input_offset", "load_torque", "quadratic_drag")


def clean_run(case: str, seed: int, seconds: float) -> Record:
    """Record of a machine that lacks nothing."""
    model, rng = load_model("axis"), np.random.default_rng(seed)
    stamp = np.arange(round(seconds / STEP)) * STEP
    command = 0.2 * rng.normal(size=int(seconds / HOLD) + 1)[(stamp / HOLD).astype(int)]
    torque = np.zeros_like(stamp)
    if case == "coloured":
        for k in range(1, len(torque)):
            torque[k] = POLE * torque[k - 1] + rng.normal()
        torque *= TORQUE * np.std(command) / np.std(torque)
    if case == "louder":
        command = command * np.where(stamp < seconds / 2.0, 1.0, 3.0)
    noise = np.column_stack([rng.normal(size=len(stamp)) * float(one.noise or 0.0) for one in model.outputs])
    output = simulate(model, stamp, command + torque, stamp, noise=noise).output
    return record_from_model(case, model, stamp, command, output)


def least_level(case: str, seed: int, looks: int, effects: tuple[str, ...]) -> float:
    """The least level at which any look at a clean machine would have been a false alarm; 1 where none would."""
    whole, least = clean_run(case, seed, FIRST + looks * PERIOD), 1.0
    found = LiveEvidence(load_model("axis"), effects=effects)
    for look in range(looks):
        start = FIRST + look * PERIOD
        stop = start + PERIOD
        earlier = whole.cut(max(start - MEMORY, 0.0), start - 0.5 * STEP)
        found = found.update([earlier], whole.cut(start, stop - 0.5 * STEP), round(stop * 1e9))
        evidences = [one.evidence for one in found.tallies.values() if one.enough]
        least = min([least, *(one.p_value(found.count) for one in evidences if one.distinguishable)])
    return least


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--looks", type=int, default=10)
    parser.add_argument("--case", choices=CASES, action="append")
    parser.add_argument("--effects", nargs="*", default=list(EFFECTS), help="none: the whole catalogue")
    given = parser.parse_args()
    np.seterr(all="ignore")
    for case in given.case or CASES:
        begun = time.monotonic()
        least = np.array([least_level(case, seed, given.looks, tuple(given.effects)) for seed in range(given.runs)])
        print(f"{case}: {given.runs} clean runs, {given.looks} looks each, {time.monotonic() - begun:.0f} s")
        for level in LEVELS:
            alarms = int(np.sum(least <= level))
            low, high = (100.0 * one for one in binomial_interval(alarms, given.runs))
            share = 100.0 * alarms / given.runs
            print(f"  level {100.0 * level:g} %: {alarms} false alarms, {share:.1f} % ({low:.1f} to {high:.1f})")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
