"""Lets the six-joint arm of `six_joint_arm/` follow a planned trajectory, and records it as a robot's bag.

The simulated drives have cogging at the elbow and Stribeck friction at the wrist roll, which the URDF does not know.

    idloop robot excite benchmarks/six_joint_arm/arm.urdf --output trajectory.csv
    python benchmarks/record_arm.py trajectory.csv bags/arm1
    python benchmarks/record_arm.py trajectory.csv bags/with_tool --payload 1.3 --seed 2
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from arm_machine import JOINTS, Hidden, Log, Machine
from arm_machine import run as simulate
from numpy.typing import NDArray

from idloop.records import make_stream, write_bag
from idloop.robots.joint_path import read_path

Array = NDArray[np.float64]

CONTROL = 0.001  # [s]
HIDDEN = (
    Hidden(2, "cogging", {"amplitude": 1.2, "harmonic": 9.0, "phase": 0.6}),
    Hidden(4, "stribeck_friction", {"share": 0.8, "velocity": 0.12}),
)
# Where the payload hangs in the frame of the last link [m].
PLACE = np.array([0.02, 0.1, 0.03])


def reference(path: Path) -> Array:
    """Position and velocity at the control rate (samples, 2, 6), from a trajectory of `idloop robot excite`."""
    planned = read_path(path)
    at = np.arange(round(planned.duration / CONTROL)) * CONTROL
    return np.stack(planned.at(at), axis=1)


def write(path: Path, log: Log) -> None:
    """Write a log as a bag of JointState, the joints in the order of their names, as many drivers have them."""
    order = sorted(JOINTS)
    columns = {
        joint: {field: getattr(log, field)[:, JOINTS.index(joint)] for field in ("position", "velocity", "effort")}
        for joint in order
    }
    stamps = np.round(log.time * 1e9).astype(np.int64) + 1_700_000_000_000_000_000
    write_bag(path, [make_stream("joint_states", stamps, columns)])


def main() -> None:
    """Record one run."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("trajectory", type=Path)
    parser.add_argument("bag", type=Path)
    parser.add_argument("--rate", type=float, default=500.0, help="of the JointState messages [Hz]")
    parser.add_argument("--payload", type=float, default=0.0, help="mass at the last link [kg]")
    parser.add_argument("--seed", type=int, default=1, help="of the noise")
    given = parser.parse_args()
    payload = (given.payload, PLACE) if given.payload else None
    given.bag.parent.mkdir(parents=True, exist_ok=True)
    write(given.bag, simulate(Machine(HIDDEN, payload), reference(given.trajectory), rate=given.rate, seed=given.seed))


if __name__ == "__main__":
    main()
