"""Do the foreign simulators agree with idloop's? The same command through all three, for every effect.

    python benchmarks/diagnosis/check.py

Differences are in standard deviations of the preset's measurement noise: `whole` is the root mean square over
the run, where an integrating machine adds up what happens at each reversal; `local` that of the change of the
difference within ten samples, which is what a one-step predictor could see. Where both foreign simulators
differ from idloop's alike and not from each other, the error is idloop's. Exits 1 when the two foreign ones
differ locally by a tenth of the noise, or one of them from idloop's by all of it.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from numpy.typing import NDArray
from simulators import machine, run

Array = NDArray[np.float64]

SAMPLES = 2000
MOST_APART, MOST_FROM_IDLOOP = 0.1, 1.0
PAIRS = (("equations", "mujoco"), ("equations", "idloop"), ("mujoco", "idloop"))


@dataclass(frozen=True)
class Trial:
    """A machine with effects, driven by random steps under a sine."""

    preset: str
    rate: float
    peak: float
    effects: tuple[str, ...] = ()


def _axis(*effects: str) -> Trial:
    return Trial("axis", 500.0, 1.0, effects)


def _torsion(*effects: str) -> Trial:
    return Trial("torsion", 250.0, 1.5, effects)


TRIALS = (
    _axis(),
    Trial("dc_motor", 100.0, 3.0),
    _torsion(),
    Trial("lead_screw", 1000.0, 10.0),
    _axis("input_offset@input(offset=0.1)"),
    _axis("gain_asymmetry@input(ratio=0.2)"),
    _axis("dead_zone@input(width=0.2)"),
    _axis("saturation@input(limit=0.6)"),
    _axis("speed_limit_voltage@input(supply=1.0,back_emf=0.05,resistance=1.0)"),
    _axis("input_delay@input(delay=0.005)"),
    _axis("actuator_lag@input(time_constant=0.01)"),
    _axis("viscous_friction@axis(coefficient=0.02)"),
    _axis("coulomb_friction@axis(level=0.1)"),
    Trial("dc_motor", 100.0, 3.0, ("coulomb_friction@motor(level=3.0)",)),
    _axis("stribeck_friction@axis(coulomb=0.1,static=0.2,velocity=0.5)"),
    _axis("asymmetric_friction@axis(level=0.2,ratio=0.3)"),
    _axis("presliding_friction@axis(level=0.2,stiffness=10)"),
    _axis("quadratic_drag@axis(coefficient=0.002)"),
    _axis("asymmetric_viscous_friction@axis(coefficient=0.01)"),
    _axis("gravity@axis(moment=0.2)"),
    _axis("gravity@axis(moment=-0.2,lowest=0.4)"),
    _axis("imbalance@axis(amplitude=0.2,phase=0.7)"),
    _axis("cogging@axis(amplitude=0.05,harmonic=6,phase=0.7)"),
    _axis("cable_spring@axis(stiffness=0.5,rest=0.3)"),
    _axis("load_torque@axis(torque=0.1)"),
    _axis("load_dependent_friction@axis(ratio=0.1)"),
    _axis("compliance@axis(stiffness=50,damping=0.01,split=0.4)"),
    _axis("compliance@axis(stiffness=5,damping=0.01,split=0.4)", "backlash@axis-axis_far(gap=0.02)"),
    _axis("backlash@position[axis](gap=0.1)"),
    _axis("sensor_quantisation@position[axis](resolution=0.01)"),
    _axis("sensor_delay@position[axis](delay=0.005)"),
    _axis("sensor_delay@velocity[axis](delay=0.0051)"),
    _axis("sensor_offset@velocity[axis](offset=0.5)"),
    _axis("sensor_ripple@velocity[axis](amplitude=0.02,harmonic=2,phase=0.3)"),
    _axis("velocity_filter@velocity[axis](time_constant=0.01)"),
    _torsion("backlash@motor-load1(gap=0.02)"),
    _torsion("hardening_stiffness@load1-load2(cubic=20)"),
    _torsion("slip@motor-load1(limit=0.05)"),
    _torsion("coulomb_friction@load2(level=0.01)"),
    _torsion("load_dependent_friction@load1(ratio=0.05)"),
    _torsion("imbalance@load2(amplitude=0.01,phase=0.3)"),
    Trial("lead_screw", 1000.0, 10.0, ("backlash@nut-stage(gap=0.1)",)),
    _axis("dead_zone@input(width=0.1)", "coulomb_friction@axis(level=0.1)", "actuator_lag@input(time_constant=0.01)"),
)


def outputs(trial: Trial, simulator: str, samples: int = SAMPLES) -> Array:
    """What the sensors show, without noise."""
    from idloop.physics import load_model

    model = load_model(trial.preset).with_effects(trial.effects)
    hold = max(int(0.15 * trial.rate), 1)
    steps = np.random.default_rng(0).uniform(-trial.peak, trial.peak, samples // hold + 1)
    command = np.repeat(steps, hold)[:samples] + 0.1 * trial.peak * np.sin(0.07 * np.arange(samples))
    quiet = np.zeros((samples, len(model.outputs)))
    built = machine(simulator, model, 1.0 / trial.rate, samples)
    return run(built, command, None, quiet, np.zeros(samples), None)[1]


def differences(trial: Trial, samples: int = SAMPLES) -> dict[tuple[str, str], tuple[float, float]]:
    """Whole and local difference of each pair of simulators, of the worst output, in deviations of the noise."""
    from idloop.physics import load_model

    std = np.array([o.noise for o in load_model(trial.preset).outputs], dtype=float)
    shown = {name: outputs(trial, name, samples) / std for name in ("idloop", "equations", "mujoco")}
    found = {}
    for pair in PAIRS:
        difference = shown[pair[0]] - shown[pair[1]]
        change = difference[10:] - difference[:-10]
        whole = np.sqrt(np.mean(difference**2, axis=0))
        local = np.sqrt(np.mean(change**2, axis=0) / 2.0)
        found[pair] = float(np.max(whole)), float(np.max(local))
    return found


def agrees(found: dict[tuple[str, str], tuple[float, float]]) -> bool:
    """Whether the local differences are within bounds."""
    return all(local < (MOST_FROM_IDLOOP if "idloop" in pair else MOST_APART) for pair, (_, local) in found.items())


def main() -> int:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    print(" " * 12 + "".join(f"{' - '.join(pair):>24}" for pair in PAIRS))
    print(" " * 12 + f"{'whole':>14}{'local':>10}" * len(PAIRS))
    failed = False
    for trial in TRIALS:
        found = differences(trial)
        cells = "".join(f"{whole:14.4f}{local:10.4f}" for whole, local in found.values())
        mark = "" if agrees(found) else "  TOO FAR APART"
        failed = failed or bool(mark)
        print(f"{trial.preset:12}{cells}  {' '.join(trial.effects) or 'linear'}{mark}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
