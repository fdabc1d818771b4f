"""Six-joint arms with hidden effects at two joints, identified: what is found, what is named falsely, and how fast.

Every arm is another one: masses, friction, hidden effects, their joints and sizes, trajectories, and the rate of the
log are drawn. MuJoCo simulates it under a position controller with encoders, noise and rounding. Two records of 20 s
are fitted, and a third judges the torque, beside a fit of the true structure: the same rigid bodies, and the hidden
effects by their true equations with the true shape.

    python benchmarks/arm.py                          # 25 arms: 100 clean joints
    python benchmarks/arm.py --arms 3 --workers 2     # and the time of each on two cores
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from arm_machine import JOINTS, URDF, Hidden, Log, Machine, fourier, hide, true_parameters
from arm_machine import run as simulate
from numpy.typing import NDArray

from idloop.robots.balance import Balance, balance_of, parameter_names, robot_motions
from idloop.robots.identify import Robot, identify
from idloop.robots.joint_records import JointRecord
from idloop.robots.rigid_body import RigidBody

Array = NDArray[np.float64]

KINDS = ("cogging", "stribeck_friction", "asymmetric_viscous_friction", "quadratic_drag")
RATES = (100.0, 250.0, 500.0, 1000.0)
DURATION = 20.0


def arm(seed: int) -> tuple[Machine, float, list[JointRecord]]:
    """Draw a machine and record it three times."""
    random = np.random.default_rng(seed)
    joints = random.choice(6, size=2, replace=False)
    kinds = random.choice(KINDS, size=2, replace=False)
    machine = Machine(
        hide([str(one) for one in kinds], [int(one) for one in joints], random),
        mass=random.uniform(0.8, 1.2, 6),
        friction=random.uniform(0.7, 1.3, 6),
    )
    rate = float(random.choice(RATES))
    logs = [simulate(machine, fourier(10 * seed + k, DURATION), rate=rate, seed=10 * seed + k) for k in range(3)]
    return machine, rate, [as_record(f"arm{seed}_{k}", log) for k, log in enumerate(logs)]


def as_record(name: str, log: Log) -> JointRecord:
    """Take a log as it would be read from a bag."""
    return JointRecord(name, JOINTS, log.time, log.position, log.velocity, log.effort)


def shapes(hidden: Hidden, balance: Balance) -> list[Array]:
    """Columns of a hidden effect whose shape is known, in the rows of a balance."""
    motion = balance.motion
    q, v = motion.position[:, hidden.joint], motion.velocity[:, hidden.joint]
    values = hidden.values
    if hidden.name == "cogging":
        columns = [np.sin(values["harmonic"] * q), np.cos(values["harmonic"] * q)]
    elif hidden.name == "stribeck_friction":
        columns = [np.sign(v) * np.exp(-((v / values["velocity"]) ** 2))]
    elif hidden.name == "asymmetric_viscous_friction":
        columns = [np.abs(v)]
    else:
        columns = [v * np.abs(v)]
    found = []
    for column in columns:
        torque = np.zeros_like(motion.position)
        torque[:, hidden.joint] = column
        found.append(balance.torque - balance.without(torque).torque)
    return found


def true_structure(machine: Machine, train: list[Balance], test: Balance, sigma: Array) -> Array:
    """Rms torque error of each joint on the unseen record by a least-squares fit of the true structure."""

    def table(balance: Balance) -> Array:
        extra = [column for one in machine.hidden for column in shapes(one, balance)]
        return np.concatenate([balance.regressor, np.stack(extra, axis=-1)], axis=2)

    rows = np.concatenate([(table(one) / sigma[:, None])[one.used] for one in train])
    torque = np.concatenate([(one.torque / sigma)[one.used] for one in train])
    length = np.linalg.norm(rows, axis=0)
    length = np.where(length > 1e-9 * length.max(), length, np.inf)
    values = np.linalg.lstsq(rows / length, torque, rcond=1e-6)[0] / length
    error = np.where(test.used, test.torque - table(test) @ values, np.nan)
    return np.asarray(np.sqrt(np.nanmean(error**2, axis=0)))


def judge(seed: int, workers: int) -> dict[str, Any]:
    """Identify one arm and compare with what it is."""
    machine, rate, records = arm(seed)
    robot = RigidBody(URDF)
    begin, used = time.perf_counter(), _processor_time()
    found = identify(
        robot, records[:2], records[2:], level=0.01, rounds=2, workers=workers, seed=seed, report=lambda *_: None
    )
    seconds, processor = time.perf_counter() - begin, _processor_time() - used
    motion = robot_motions(records, [False] * 6)
    test = balance_of(robot, motion[2])
    ours = next(one for one in found.errors if one.unseen).rms
    best = true_structure(machine, list(found.balances), test, found.fit.sigma)
    wanted = {one.joint: one.name for one in machine.hidden}
    added = {place: one.added for place, one in enumerate(found.ladders) if one.added}
    named = {
        place: any(
            name in {step.added.name.partition("@")[0], *(rival.partition("@")[0] for rival in step.set)}
            for step in found.ladders[place].steps
            if step.added is not None
        )
        for place, name in wanted.items()
    }
    held, total = covered(machine, found)
    return {
        "seed": seed,
        "rate": rate,
        "hidden": {JOINTS[place]: name for place, name in wanted.items()},
        "added": {JOINTS[place]: list(names) for place, names in added.items()},
        "named": sum(named.values()),
        "also": {JOINTS[p]: list(added[p][1:]) for p in added if p in wanted and len(added[p]) > 1},
        "false": {JOINTS[place]: list(names) for place, names in added.items() if place not in wanted},
        "ratio": (ours / best).tolist(),
        "intervals": [held, total],
        "seconds": seconds,
        "processor_seconds": processor,
    }


def covered(machine: Machine, found: Robot) -> tuple[int, int]:
    """Base parameters whose 95 % interval holds the true value, and all."""
    links, own = true_parameters(machine)
    for one in machine.hidden:
        if one.name == "stribeck_friction":
            own[one.joint, 2] = np.nan  # its effect has the whole dry friction
    true = dict(zip(parameter_names(JOINTS), [*links.ravel(), *own.ravel()], strict=True))
    held = total = 0
    for one in found.fit.base:
        value = true.get(one.name, np.nan) + sum(factor * true[name] for name, factor in one.others.items())
        if np.isfinite(value):
            low, high = one.interval
            held += bool(low <= value <= high)
            total += 1
    return held, total


def _processor_time() -> float:
    return sum(
        usage.ru_utime + usage.ru_stime
        for usage in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def main() -> None:
    """Run the arms and print what was counted."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--arms", type=int, default=25)
    parser.add_argument("--first", type=int, default=0, help="seed of the first arm")
    parser.add_argument("--workers", type=int, default=0, help="processes of each identification; 0: none")
    parser.add_argument("--output", type=Path, help="a JSON line for each arm")
    given = parser.parse_args()
    rows = []
    for seed in range(given.first, given.first + given.arms):
        row = judge(seed, given.workers)
        rows.append(row)
        print(json.dumps({key: row[key] for key in ("seed", "rate", "hidden", "added", "seconds")}), flush=True)
        if given.output is not None:
            with given.output.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
    print(summary(rows))


def summary(rows: list[dict[str, Any]]) -> str:
    """What all arms show together."""
    hidden, clean = 2 * len(rows), 4 * len(rows)
    ratios = np.array([row["ratio"] for row in rows])
    held, total = np.sum([row["intervals"] for row in rows], axis=0)
    seconds = [row["seconds"] for row in rows]
    processor = [row["processor_seconds"] for row in rows]
    whole = np.sqrt(np.mean(ratios**2, axis=1))
    lines = {
        "hidden effects named at their joints": f"{sum(row['named'] for row in rows)} of {hidden}",
        "clean joints with a false effect": f"{sum(len(row['false']) for row in rows)} of {clean}",
        "hidden joints with a further effect": f"{sum(len(row['also']) for row in rows)} of {hidden}",
        "torque error of a joint, unseen, over that of the true structure refitted": _spread(ratios.ravel()),
        "the same, rms of an arm": _spread(whole),
        "95 % intervals of base parameters that hold the truth": f"{held} of {total} ({100 * held / total:.1f} %)",
        "time [s]": _spread(np.array(seconds)),
        "time of the processor [s]": _spread(np.array(processor)),
    }
    return "\n".join(f"{what}: {found}" for what, found in lines.items())


def _spread(values: Array) -> str:
    return f"median {np.median(values):.4g}, 95 % below {np.quantile(values, 0.95):.4g}, largest {np.max(values):.4g}"


if __name__ == "__main__":
    main()
