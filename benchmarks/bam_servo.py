"""A hobby servo in position mode, fitted at one gain of its loop and simulated at the others.

    .venv/bin/python benchmarks/bam_servo.py            # needs bam_servo_pendulum below IDLOOP_DATA, else one line

Logs of a Dynamixel XL330 that lifts a pendulum of known mass and length (Duclusaud et al., Extended Friction Models for
the Physics Simulation of Servo Actuators, arXiv:2410.08650; logs and models: github.com/Rhoban/bam). The model knows
the loop: 4096 counts per turn, gain over 256 in PWM steps of 885, the supply. Inertia, friction and motor are fitted to
the free runs at one gain. The mean absolute error of the position is over whole free runs from the set-points alone, of
logs in which the drive stays on. Beside it stands the best of the publication's six models for this servo (its file
m3.json, which is not bound to one gain), run by its own simulator on the same logs.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np

import idloop
from idloop.physics import Model, simulate
from idloop.physics.model_file import from_text

DATA = Path(os.environ.get("IDLOOP_DATA", "../shared/data")) / "bam_servo_pendulum" / "xl330_raw"
SUPPLY, STEPS, DIVISOR, COUNTS = 7.35, 885.0, 256.0, 4096.0
FITTED = 200
# Mean absolute error [mrad] by gain of m3.json, on the logs in which the drive stays on.
PUBLISHED = {100: 29.8, 200: 71.0, 400: 70.9, 800: 127.0}
MODEL = """
schema: idloop/model/1
name: xl330
input: {{joint: arm, field: position, unit: rad}}
outputs: [{{joint: arm, field: position, unit: rad}}]
bodies: [{{name: arm, inertia: {{value: 0.0055}}, viscous_friction: {{value: 0.05, min: 0}}}}]
drive: {{kind: position_loop, unit: V, gain: {{value: 0.15, min: 0}}, proportional: {gain}, limit: {supply}}}
effects:
- {{effect: gravity, at: arm, moment: {moment}, lowest: {{value: 0.0}}}}
- {{effect: load_dependent_friction, at: arm, ratio: {{value: 0.3}}}}
"""

Log = tuple[str, np.ndarray, np.ndarray, np.ndarray]


def logs(gain: int) -> tuple[list[Log], float]:
    """Trajectory, stamps, set-points and positions of each log at one gain, and the pendulum's moment [N·m]."""
    found, moment = [], 0.0
    for path in sorted(DATA.glob("*.json")):
        log = json.loads(path.read_text(encoding="utf-8"))
        entries = log["entries"]
        if log["kp"] != gain or not all(entry["torque_enable"] for entry in entries):
            continue
        moment = 9.81 * log["mass"] * log["length"]
        time, goal, place = (
            np.array([entry[key] for entry in entries]) for key in ("timestamp", "goal_position", "position")
        )
        rises = np.append(True, np.diff(time) > 0.0)
        found.append((log["trajectory"], time[rises] - time[0], goal[rises], place[rises]))
    return found, moment


def at_gain(gain: int) -> float:
    """Gain of the loop in V/rad."""
    return gain / DIVISOR * COUNTS / (2.0 * np.pi) / STEPS * SUPPLY


def errors(model: Model, gain: int) -> list[float]:
    """Mean absolute error [mrad] of the free run of each log."""
    there = model.with_values({"drive.proportional": at_gain(gain)})
    return [
        1e3 * float(np.mean(np.abs(simulate(there, time, goal, time, [place[0]], [0.0]).output[:, 0] - place)))
        for _, time, goal, place in logs(gain)[0]
    ]


def main() -> None:
    """Fit, and print a row for each gain."""
    if not DATA.is_dir():
        sys.exit(f"skipped: no {DATA}: set IDLOOP_DATA")
    own, moment = logs(FITTED)
    model = from_text(MODEL.format(gain=at_gain(FITTED), supply=SUPPLY, moment=moment), None)
    records = [
        idloop.Record.from_arrays(time, goal, {"position": place}, model, name=name) for name, time, goal, place in own
    ]
    fitted = idloop.fit(model, records, criterion="simulation")
    print(fitted.summary())
    print(f"{'gain':>5}  {'':8}  {'mean absolute error [mrad]':>26}  {'publication':>11}")
    for gain, published in PUBLISHED.items():
        found = errors(fitted.model, gain)
        kind = "fitted" if gain == FITTED else "held out"
        print(f"{gain:5d}  {kind:8}  {np.mean(found):26.1f}  {published:11.1f}")


if __name__ == "__main__":
    main()
