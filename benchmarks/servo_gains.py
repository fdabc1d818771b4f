"""Whether an identified machine depends on the gains of its servo: a MuJoCo position actuator with three gains.

    .venv/bin/python benchmarks/servo_gains.py                     # a table: what was found beside what is true
    .venv/bin/python benchmarks/servo_gains.py --unknown           # the gains are estimated as well
    .venv/bin/python benchmarks/servo_gains.py --soft              # with MuJoCo's usual dry friction

A pendulum under a position actuator with a limited force, whose set-point arrives 10 ms late, read by an encoder of 12
bits at 200 Hz. The model knows the gains, not the machine; `idloop.refine` finds friction, gravity and the limit. With
unknown gains the model has friction, gravity and the limit, and `idloop.fit` starts from gains that are far off.

MuJoCo's dry friction is a constraint with a time constant of 20 ms: its sign is that of v + 9.5 ms a, about. Here the
time constant is 1 ms, so that it is Coulomb friction; `--soft` leaves it at 20 ms.
"""

from __future__ import annotations

import sys
import time

import mujoco
import numpy as np

import idloop
from idloop.physics.model_file import from_text

MACHINE = """
<mujoco>
  <option timestep="0.0005" integrator="implicitfast"/>
  <worldbody><body><joint name="arm" axis="0 1 0" damping="0.03" frictionloss="0.12" armature="0.008" {friction}/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.015" mass="0.35"/></body></worldbody>
  <actuator><position joint="arm" kp="{kp}" kv="{kv}" forcerange="-3 3"/></actuator>
</mujoco>
"""
MODEL = """
schema: idloop/model/1
name: servo
input: {{joint: arm, field: position, unit: rad}}
outputs: [{{joint: arm, field: position, unit: rad}}]
bodies: [{{name: arm, inertia: {{value: 0.05}}, viscous_friction: {{value: 0.01, min: 0}}}}]
drive: {{kind: position_loop, unit: N·m, proportional: {kp}, derivative: {kv}}}
effects: [{{effect: input_delay, at: input, delay: {{value: 0.004}}}}]
"""
RIGID = 'solreffriction="0.001 1" solimpfriction="0.99 0.999 0.001 0.5 2"'
GAINS, BRAKING, STEP, LATE, COUNTS = (6.0, 15.0, 40.0), 0.2, 0.005, 0.01, 4096


def recorded(kp: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Stamps, set-points, positions, and the inertia about the joint."""
    friction = "" if "--soft" in sys.argv[1:] else RIGID
    machine = mujoco.MjModel.from_xml_string(MACHINE.format(kp=kp, kv=BRAKING, friction=friction))
    data, random = mujoco.MjData(machine), np.random.default_rng(seed)
    stamps = np.arange(0.0, 20.0, STEP)
    levels = np.interp(stamps, np.arange(0.0, 21.0), random.uniform(-1.2, 1.2, 21))
    wanted = levels + 0.25 * np.sin(10.7 * stamps) + 0.3 * (np.sin(2.5 * stamps) > 0.0)
    each, late = round(STEP / machine.opt.timestep), round(LATE / machine.opt.timestep)
    sent = np.concatenate([np.zeros(late), np.repeat(wanted, each)])
    position = np.empty(len(stamps))
    for k in range(len(stamps)):
        position[k] = data.qpos[0]
        for own in sent[k * each : (k + 1) * each]:
            data.ctrl[0] = own
            mujoco.mj_step(machine, data)
    count = 2.0 * np.pi / COUNTS
    inertia = 0.008 + machine.body_inertia[1][1] + machine.body_mass[1] * machine.body_ipos[1][2] ** 2
    return stamps, wanted, np.round((position + random.normal(0.0, 1e-4, len(stamps))) / count) * count, float(inertia)


def without_gains() -> None:
    """Print what a fit finds from gains that are far off."""
    known = "proportional: {kp}, derivative: {kv}"
    off = "proportional: {{value: 5.0, min: 0}}, derivative: {{value: 0.02, min: 0}}, limit: 3.0"
    for kp in GAINS:
        text = MODEL.replace(known, off).format(kp=kp, kv=BRAKING)
        model = from_text(text, None).with_effects(["coulomb_friction@arm", "gravity@arm"])
        stamps, wanted, position, _ = recorded(kp, 0)
        fitted = idloop.fit(model, idloop.Record.from_arrays(stamps, wanted, {"position": position}, model))
        print(f"gain {kp:g}, derivative {BRAKING:g}\n{fitted.summary()}\n")


def main() -> None:
    """Print a table with a row for each gain."""
    if "--unknown" in sys.argv[1:]:
        without_gains()
        return
    keys = ("arm.inertia", "arm.viscous_friction", "coulomb_friction@arm.level", "gravity@arm.moment")
    print(f"{'gain':>6} " + " ".join(f"{key:>28}" for key in (*keys, "saturation@input.limit")) + "   time [s]")
    for kp in GAINS:
        model, records = from_text(MODEL.format(kp=kp, kv=BRAKING), None), []
        for seed in (0, 1):
            stamps, wanted, position, inertia = recorded(kp, seed)
            records.append(idloop.Record.from_arrays(stamps, wanted, {"position": position}, model, name=f"run{seed}"))
        began = time.perf_counter()
        found = idloop.refine(model, records[0], validate=records[1]).model.values
        row = [f"{found.get(key, float('nan')):.4g}" for key in (*keys, "saturation@input.limit")]
        print(f"{kp:6g} " + " ".join(f"{cell:>28}" for cell in row) + f"   {time.perf_counter() - began:.0f}")
    print("  true " + " ".join(f"{cell:>28.4g}" for cell in (inertia, 0.03, 0.12, 0.35 * 9.81 * 0.125, 3.0)))


if __name__ == "__main__":
    main()
