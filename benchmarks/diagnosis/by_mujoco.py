"""Machines simulated by MuJoCo: every body a hinge, every coupling a tendon.

MuJoCo's own features carry what they can: dry friction (``frictionloss``), springs and dampers
(tendons), a gap (``springlength`` as a range), a return spring (``springref``), an off-centre mass
under gravity, the actuator's gear, limit and lag. What MuJoCo lacks is computed from the catalogue's
equations: in the passive callback where it depends on the motion, once per step otherwise.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from plain import Plain
from sensors import sensors

Array = NDArray[np.float64]

GRAVITY = 9.81
# Integration steps are at most this long [s] ...
LONGEST_STEP = 2.5e-4
# ... and at least so many in a sample; what switches is a matter of first order in the step.
FEWEST_STEPS = 10
FEWEST_STEPS_SWITCHING = 40
SWITCHING = (
    "coulomb_friction",
    "stribeck_friction",
    "asymmetric_friction",
    "load_dependent_friction",
    "backlash",
    "slip",
)


class MujocoMachine:
    """A machine that is stepped sample by sample.

    Parameters
    ----------
    plain : Plain
        The machine.
    sample_time : float
        Seconds between samples.
    samples : int
        How many there will be.
    """

    def __init__(self, plain: Plain, sample_time: float, samples: int) -> None:
        self._plain = plain
        switching = any(effect.name in SWITCHING for effect in plain.effects)
        self._substeps = max(
            FEWEST_STEPS_SWITCHING if switching else FEWEST_STEPS, math.ceil(sample_time / LONGEST_STEP)
        )
        self._step = sample_time / self._substeps
        self._model: Any = mujoco.MjModel.from_xml_string(document(plain, self._step))
        self._data: Any = mujoco.MjData(self._model)
        self._sensors = sensors(plain, self._step)
        self._follow = any(sensor.remembers for sensor in self._sensors)
        self._commands = np.zeros(samples + 1)
        self._sample = 0
        self._input = {e.name: e.values for e in plain.effects if e.kind == "input"}
        self._delay = round(self._input.get("input_delay", {}).get("delay", 0.0) / self._step)
        self._supply = self._input.get("speed_limit_voltage")
        self._lag = self._input.get("actuator_lag", {}).get("time_constant", 0.0)
        self._value = self._lagged = 0.0
        n = len(plain.inertia)
        self._constant = np.zeros(n)
        for effect in plain.of("load_torque"):
            self._constant[effect.index] += effect.values["torque"]
        for effect in plain.of("asymmetric_friction"):
            # friction that differs by direction is friction that does not, and a constant
            self._constant[effect.index] -= effect.values["level"] * effect.values["ratio"]
        self._bristle, self._slipped = np.zeros(n), np.zeros(n)
        self._own_forces = [
            e for e in plain.effects if e.name in _FORCES or (e.name == "backlash" and e.kind == "coupling")
        ]
        self._levels = [e for e in plain.effects if e.name in ("stribeck_friction", "load_dependent_friction")]
        self._states = [e for e in plain.effects if e.name in ("presliding_friction", "slip")]
        self._each_step = bool(
            self._follow or self._levels or self._states or self._delay or (self._supply and self._lag)
        )
        mujoco.mj_forward(self._model, self._data)

    def measure(self, noise: Array) -> Array:
        """Read the sensors now."""
        if not self._follow:
            self._sense()
        return np.array([s.read(float(e)) for s, e in zip(self._sensors, noise, strict=True)])

    def step(self, command: float, disturbance: float) -> None:
        """Hold a command and a disturbance for one sample."""
        self._commands[self._sample] = command
        data = self._data
        data.qfrc_applied[:] = self._constant
        data.qfrc_applied[0] += disturbance
        wanted = bool(self._own_forces or self._supply)
        mujoco.set_mjcb_passive(self._passive if wanted else None)
        if self._each_step:
            for sub in range(self._substeps):
                late = self._sample * self._substeps + sub - self._delay
                self._act(float(self._commands[late // self._substeps]) if late >= 0 else 0.0)
                self._set_levels()
                mujoco.mj_step(self._model, data)
                self._settle()
                if self._follow:
                    self._sense()
        else:
            self._act(command)
            mujoco.mj_step(self._model, data, self._substeps)
        mujoco.set_mjcb_passive(None)
        self._sample += 1

    def _sense(self) -> None:
        position, velocity = self._data.qpos, self._data.qvel
        for sensor, output in zip(self._sensors, self._plain.outputs, strict=True):
            sensor.follow(float(position[output.body]), float(velocity[output.body]))

    def _act(self, command: float) -> None:
        """Static errors of the input, then the actuator; its limit is MuJoCo's when nothing else is there."""
        inputs, value = self._input, command
        if "gain_asymmetry" in inputs or "input_offset" in inputs or "dead_zone" in inputs:
            limit = inputs.get("saturation", {}).get("limit", math.inf)
            value = min(max(value, -limit), limit)
        value += inputs.get("gain_asymmetry", {}).get("ratio", 0.0) * abs(value)
        value += inputs.get("input_offset", {}).get("offset", 0.0)
        if "dead_zone" in inputs:
            up = inputs["dead_zone"]["width"]
            down = inputs["dead_zone"].get("width_negative", up)
            value = value - up if value > up else value + down if value < -down else 0.0
        if self._supply is None:
            self._data.ctrl[0] = value
            return
        if self._lag > 0.0:
            middle = math.exp(-0.5 * self._step / self._lag)
            self._value = value + (self._lagged - value) * middle
            self._lagged = value + (self._lagged - value) * middle * middle
        else:
            self._value = value

    def _passive(self, model: Any, data: Any) -> None:
        """Forces that MuJoCo does not have."""
        position, velocity, force = data.qpos, data.qvel, data.qfrc_passive
        if self._supply is not None:
            s, speed = self._supply, float(velocity[0])
            high = (s["supply"] - s["back_emf"] * speed) / s["resistance"]
            low = (-s["supply"] - s["back_emf"] * speed) / s["resistance"]
            force[0] += self._plain.gain * min(max(self._value, low), high)
        for effect in self._own_forces:
            i, value = effect.index, effect.values
            x, v = float(position[i]), float(velocity[i])
            if effect.kind == "body":
                memory = float(self._bristle[i])
                force[i] += _FORCES[effect.name](value, x, v, memory)
                continue
            twist, rate = x - float(position[i + 1]), v - float(velocity[i + 1])
            stiffness, damping = self._plain.stiffness[i], self._plain.damping[i]
            if effect.name == "backlash":
                torque = damping * rate if abs(twist) > 0.5 * value["gap"] else 0.0
            elif effect.name == "hardening_stiffness":
                torque = value["cubic"] * twist**3
            else:
                torque = stiffness * (twist - float(self._slipped[i])) + damping * rate
                torque = min(max(torque, -value["limit"]), value["limit"])
            force[i] -= torque
            force[i + 1] += torque

    def _set_levels(self) -> None:
        """Dry friction that depends on speed or load: the level of the coming step."""
        velocity = self._data.qvel
        for effect in self._levels:
            i, value = effect.index, effect.values
            if effect.name == "stribeck_friction":
                ratio = float(velocity[i]) / value["velocity"]
                level = value["coulomb"] + (value["static"] - value["coulomb"]) * math.exp(-ratio * ratio)
            else:
                level = value["ratio"] * abs(self._arriving(i))
            # a level of 0 would take the constraint away
            self._model.dof_frictionloss[i] = max(level, 1e-12)

    def _arriving(self, body: int) -> float:
        """Torque that the drive train brings to a body."""
        if body == 0:
            if self._lag > 0.0:
                return self._plain.gain * float(self._data.act[0])
            limit = self._input.get("saturation", {}).get("limit", math.inf)
            return self._plain.gain * min(max(float(self._data.ctrl[0]), -limit), limit)
        position, velocity = self._data.qpos, self._data.qvel
        twist = float(position[body - 1] - position[body])
        return self._plain.stiffness[body - 1] * twist + self._plain.damping[body - 1] * float(
            velocity[body - 1] - velocity[body]
        )

    def _settle(self) -> None:
        """Bring bristles and slipped couplings to the end of a step."""
        position, velocity = self._data.qpos, self._data.qvel
        for effect in self._states:
            i, value = effect.index, effect.values
            if effect.name == "slip":
                twist = float(position[i] - position[i + 1]) - float(self._slipped[i])
                rate = float(velocity[i] - velocity[i + 1])
                excess = self._plain.stiffness[i] * twist + self._plain.damping[i] * rate
                if abs(excess) > value["limit"]:
                    excess -= math.copysign(value["limit"], excess)
                    self._slipped[i] += excess / self._plain.stiffness[i]
                continue
            speed = float(velocity[i])
            limit = bristle_limit(value, speed)
            if speed != 0.0:
                end = math.copysign(limit, speed)
                keep = math.exp(-abs(speed) * self._step / limit)
                self._bristle[i] = end + (self._bristle[i] - end) * keep


def bristle_limit(value: dict[str, float], speed: float) -> float:
    """Deflection of the bristles in steady sliding."""
    level, ratio = value["level"], speed / value["velocity"]
    static = value.get("static", level)
    return (level + (static - level) * math.exp(-ratio * ratio)) / value["stiffness"]


def _drag(value: dict[str, float], x: float, v: float, z: float) -> float:
    return -value["coefficient"] * abs(v) * v


def _one_way_drag(value: dict[str, float], x: float, v: float, z: float) -> float:
    return -value["coefficient"] * abs(v)


def _cogging(value: dict[str, float], x: float, v: float, z: float) -> float:
    return -value["amplitude"] * math.sin(value["harmonic"] * x + value["phase"])


def _presliding(value: dict[str, float], x: float, v: float, z: float) -> float:
    rate = v - abs(v) * z / bristle_limit(value, v)
    return -(value["stiffness"] * z + value["damping"] * rate)


def _at_coupling(value: dict[str, float], x: float, v: float, z: float) -> float:
    raise NotImplementedError


_FORCES = {
    "quadratic_drag": _drag,
    "asymmetric_viscous_friction": _one_way_drag,
    "cogging": _cogging,
    "presliding_friction": _presliding,
    "hardening_stiffness": _at_coupling,
    "slip": _at_coupling,
}


def document(plain: Plain, step: float) -> str:
    """MJCF of a machine."""
    bodies, joints = [], range(len(plain.inertia))
    at_body = {(e.name, e.index): e.values for e in plain.effects if e.kind == "body"}
    at_joint = {(e.name, e.index): e.values for e in plain.effects if e.kind == "coupling"}
    inputs = {e.name: e.values for e in plain.effects if e.kind == "input"}
    for i in joints:
        viscous = plain.viscous[i] + at_body.get(("viscous_friction", i), {}).get("coefficient", 0.0)
        joint = f'name="j{i}" type="hinge" axis="0 0 1" damping="{viscous!r}"'
        level = sum(
            at_body.get((name, i), {}).get("level", 0.0) for name in ("coulomb_friction", "asymmetric_friction")
        )
        if level > 0.0 or any((name, i) in at_body for name in ("stribeck_friction", "load_dependent_friction")):
            # a constraint that is stiff beside the step and hardly softened, so that rest is rest
            joint += (
                f' frictionloss="{max(level, 1e-12)!r}" solreffriction="{2.0 * step!r} 1"'
                ' solimpfriction="0.9999 0.9999 0.001 0.5 2"'
            )
        spring = at_body.get(("cable_spring", i))
        if spring is not None:
            joint += f' stiffness="{spring["stiffness"]!r}" springref="{spring["rest"]!r}"'
        inertia, mass, place = plain.inertia[i], 1.0, (0.0, 0.0)
        weight = at_body.get(("imbalance", i))
        hanging = at_body.get(("gravity", i))
        if hanging is not None:
            upright = math.pi if hanging["moment"] < 0.0 else 0.0
            weight = {"amplitude": abs(hanging["moment"]), "phase": upright - hanging["lowest"]}
        if weight is not None and weight["amplitude"] > 0.0:
            # an off-centre mass whose own inertia is a hundredth of the body's
            arm = 0.01 * inertia * GRAVITY / weight["amplitude"]
            mass = weight["amplitude"] / (GRAVITY * arm)
            angle = weight["phase"] - 0.5 * math.pi
            place = (arm * math.cos(angle), arm * math.sin(angle))
            inertia *= 0.99
        bodies.append(
            f'<body name="b{i}"><joint {joint}/><inertial pos="{place[0]!r} {place[1]!r} 0" mass="{mass!r}"'
            f' diaginertia="{inertia!r} {inertia!r} {inertia!r}"/></body>'
        )
    tendons = []
    for i in joints[:-1]:
        stiffness, damping, half = plain.stiffness[i], plain.damping[i], 0.0
        if ("slip", i) in at_joint:
            stiffness = damping = 0.0
        if ("backlash", i) in at_joint:
            half, damping = 0.5 * at_joint["backlash", i]["gap"], 0.0
        tendons.append(
            f'<fixed stiffness="{stiffness!r}" damping="{damping!r}" springlength="{-half!r} {half!r}">'
            f'<joint joint="j{i}" coef="1"/><joint joint="j{i + 1}" coef="-1"/></fixed>'
        )
    actuator = f'joint="j0" gear="{plain.gain!r}"'
    others = {"gain_asymmetry", "input_offset", "dead_zone", "speed_limit_voltage"}
    if "saturation" in inputs and not others & set(inputs):
        limit = inputs["saturation"]["limit"]
        actuator += f' ctrllimited="true" ctrlrange="{-limit!r} {limit!r}"'
    if "actuator_lag" in inputs and "speed_limit_voltage" not in inputs:
        actuator += f' dyntype="filter" dynprm="{inputs["actuator_lag"]["time_constant"]!r}"'
    return (
        f'<mujoco><compiler angle="radian"/><option timestep="{step!r}" integrator="RK4"'
        f' gravity="0 {-GRAVITY} 0" tolerance="1e-14" iterations="200"><flag contact="disable"/></option>'
        f"<worldbody>{''.join(bodies)}</worldbody><tendon>{''.join(tendons)}</tendon>"
        f"<actuator><general {actuator}/></actuator></mujoco>"
    )
