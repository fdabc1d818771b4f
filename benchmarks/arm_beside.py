"""The arms of `arm.py`, identified by idloop, by FIGAROH and by MuJoCo's sysid from the same records.

    pip install figaroh 'mujoco[sysid]'
    python benchmarks/arm_beside.py --seed 1

All three start from the URDF. FIGAROH gets the smoothed motion of idloop and its own regressor (friction, rotor
inertia, offset), base parameters, decimation and weighted least squares. MuJoCo's sysid fits pseudo-inertias, damping,
friction and armature to windows of 0.2 s, one every 1.5 s, that start at the measured state. Compared is the torque
along the unseen record, where the joints move. What is not installed is left out.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from arm import KINDS, RATES, arm, true_structure
from arm_machine import JOINTS, MJCF, URDF, parameters_of
from numpy.typing import NDArray

from idloop.robots.balance import Balance, RobotMotion, balance_of, robot_motions
from idloop.robots.identify import identify
from idloop.robots.joint_records import JointRecord
from idloop.robots.rigid_body import RigidBody

Array = NDArray[np.float64]

WINDOW, EVERY, STEP = 0.2, 1.5, 0.001  # of sysid's rollouts [s]
ITERATIONS = 30


def by_figaroh(motions: list[RobotMotion], test: Balance) -> Array:
    """Torque error along the unseen record, shape (rows, joints)."""
    from figaroh.tools.load_robot import load_robot
    from figaroh.tools.qrdecomposition import get_baseIndex
    from figaroh.tools.regressor import RegressorBuilder, RegressorConfig
    from scipy.signal import decimate

    robot = load_robot(str(URDF), loader="figaroh")
    options = RegressorConfig(
        has_friction=True, has_actuator_inertia=True, has_joint_offset=True, is_joint_torques=True
    )
    builder = RegressorBuilder(robot, options)
    active = {"act_idxv": list(range(6))}

    def rows(motion: RobotMotion) -> Array:
        return np.asarray(
            builder.build_basic_regressor(motion.position, motion.velocity, motion.acceleration, active)
        ).reshape(6, len(motion.position), -1)

    def thinned(values: Array) -> Array:
        return np.asarray(decimate(values, 10, axis=1, zero_phase=True))

    tables = [rows(motion) for motion in motions[:2]]
    table = np.concatenate([thinned(one) for one in tables], axis=1)
    torque = np.concatenate([thinned(one.record.effort.T) for one in motions[:2]], axis=1)
    flat = table.reshape(-1, table.shape[-1])
    shown = np.flatnonzero(np.sum(flat**2, axis=0) > 1e-3)
    base = shown[list(get_baseIndex(flat[:, shown], [str(place) for place in shown]))]
    weight = np.ones(6)
    for _ in range(2):  # ordinary, then weighted least squares
        scaled = (table[:, :, base] * weight[:, None, None]).reshape(-1, len(base))
        values = np.linalg.lstsq(scaled, (torque * weight[:, None]).ravel(), rcond=None)[0]
        weight = 1.0 / np.std(torque - table[:, :, base] @ values, axis=1)
    modelled = (rows(motions[2])[:, :, base] @ values).T
    return test.without(modelled).torque


def by_sysid(records: list[JointRecord], test: Balance) -> Array:
    """Torque error along the unseen record, shape (rows, joints)."""
    import mujoco
    from mujoco import sysid

    spec: Any = mujoco.MjSpec.from_file(str(MJCF))
    spec.option.timestep = STEP
    nominal = RigidBody(URDF).nominal.reshape(6, 10)
    for joint, link in zip(JOINTS, nominal, strict=True):
        body, mass, centre = spec.body(f"{joint}_link"), float(link[0]), link[1:4] / link[0]
        about = np.array([[link[4], link[5], link[7]], [link[5], link[6], link[8]], [link[7], link[8], link[9]]])
        about -= mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        body.mass, body.ipos = mass, centre
        body.fullinertia = about[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        spec.add_sensor(
            name=f"{joint}_p", type=mujoco.mjtSensor.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=joint
        )
        spec.add_sensor(
            name=f"{joint}_v", type=mujoco.mjtSensor.mjSENS_JOINTVEL, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=joint
        )
    model = spec.compile()
    parameters = sysid.ParameterDict()
    for joint in JOINTS:
        parameters.add(
            sysid.body_inertia_param(
                spec, model, f"{joint}_link", inertia_type=sysid.InertiaType.Pseudo, modifier=_inertia_setter(joint)
            )
        )
        for key, start, most in (("damping", 1.0, 20.0), ("frictionloss", 1.0, 20.0), ("armature", 0.1, 3.0)):
            parameters.add(sysid.Parameter(f"{joint}_{key}", start, 1e-4, most, modifier=_setter(joint, key)))
    starts, controls, sensed, names = [], [], [], []
    order = [(place, field) for place in range(6) for field in ("position", "velocity")]
    for record in records:
        length = round(WINDOW / record.sample_time)
        table = np.column_stack([getattr(record, field)[:, place] for place, field in order])
        for first in range(0, len(record.time) - length, round(EVERY / record.sample_time)):
            own = slice(first, first + length)
            when = record.time[own] - record.time[first]
            starts.append(sysid.create_initial_state(model, record.position[first], record.velocity[first]))
            controls.append(sysid.TimeSeries(when, record.effort[own]))
            sensed.append(sysid.TimeSeries.from_names(when, table[own], model))
            names.append(f"{record.name}_{first}")
    sequences = sysid.ModelSequences("arm", spec, names, starts, controls, sensed)
    residual = sysid.build_residual_fn(models_sequences=[sequences], n_threads=1)
    found, _ = sysid.optimize(
        initial_params=parameters, residual_fn=residual, optimizer="mujoco", verbose=False, max_iters=ITERATIONS
    )
    links, own_values = parameters_of(sysid.apply_param_modifiers(found, spec))
    return test.error(np.concatenate([links.ravel(), own_values.ravel()]))


def _inertia_setter(joint: str) -> Callable[[Any, Any], None]:
    from mujoco import sysid

    def write(spec: Any, parameter: Any) -> None:
        sysid.apply_body_inertia(spec, f"{joint}_link", parameter)
        # MuJoCo 4.0.0 refuses the orientation that is not a number, which sysid leaves beside a full inertia.
        spec.body(f"{joint}_link").iquat[:] = [1.0, 0.0, 0.0, 0.0]

    return write


def _setter(joint: str, key: str) -> Callable[[Any, Any], None]:
    def write(spec: Any, parameter: Any) -> None:
        value = float(parameter.value[0])
        # Damping has a column for each power of the speed.
        setattr(spec.joint(joint), key, [value, 0.0, 0.0] if key == "damping" else value)

    return write


def main() -> None:
    """Identify an arm three times and print the torque errors and times."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    machine, rate, records = arm(given.seed)
    print(f"arm {given.seed}: {rate:g} Hz of {RATES}, hidden {[one.name for one in machine.hidden]} of {KINDS}")
    motions = robot_motions(records, [False] * 6)
    robot = RigidBody(URDF)
    balances = [balance_of(robot, one) for one in motions]
    test = balances[2]
    errors, seconds = {}, {}

    def add(name: str, run: Callable[[], Array]) -> None:
        begin = time.process_time()
        try:
            error = run()
        except ImportError as missing:
            print(f"{name}: left out, {missing}")
            return
        seconds[name] = time.process_time() - begin
        errors[name] = np.sqrt(np.nanmean(np.where(test.used, error, np.nan) ** 2, axis=0))

    def ours() -> Array:
        found = identify(
            robot, records[:2], [], level=0.01, rounds=2, workers=0, seed=given.seed, report=lambda *_: None
        )
        print({JOINTS[place]: one.added for place, one in enumerate(found.ladders) if one.added})
        nonlocal best
        best = true_structure(machine, balances[:2], test, found.fit.sigma)
        return test.without(found.effects(motions[2])).error(found.fit.parameters)

    best = np.full(6, np.nan)
    add("idloop", ours)
    add("FIGAROH", lambda: by_figaroh(motions, test))
    add("MuJoCo sysid", lambda: by_sysid(records[:2], test))
    print(f"{'torque error [N·m]':<24}{''.join(f'{joint:>13}' for joint in JOINTS)}   processor s")
    print(f"{'true structure':<24}{''.join(f'{value:13.4f}' for value in best)}")
    for name, values in errors.items():
        print(f"{name:<24}{''.join(f'{value:13.4f}' for value in values)}{seconds[name]:14.1f}")


if __name__ == "__main__":
    main()
