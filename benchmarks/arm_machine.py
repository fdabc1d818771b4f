"""The six-joint arm of `six_joint_arm/`, simulated by MuJoCo under a position controller, as its drives would log it.

Rigid bodies, rotor inertias, viscous and Coulomb friction are MuJoCo's; what MuJoCo lacks, the hidden effects, is
computed here from the motion at every step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FOLDER = Path(__file__).parent / "six_joint_arm"
URDF, MJCF = FOLDER / "arm.urdf", FOLDER / "arm.xml"
JOINTS = ("base_yaw", "shoulder", "elbow", "wrist_pitch", "wrist_roll", "tool")
POSITION_LIMIT = np.array([2.6, 1.7, 2.2, 2.0, 2.6, 2.6])
VELOCITY_LIMIT = np.array([2.0, 2.0, 2.5, 3.0, 3.0, 3.0])
EFFORT_LIMIT = np.array([150.0, 150.0, 80.0, 30.0, 30.0, 20.0])
_CONTROL = 0.001  # [s]
_BANDWIDTH = 2.0 * math.pi * 6.0  # of the position controller [rad/s]
_QUANTUM = 2.0 * math.pi / 2**17  # of the encoders [rad]
_VELOCITY_NOISE = 0.002  # [rad/s]
_EFFORT_NOISE, _EFFORT_QUANTUM = 0.004, 0.001  # parts of the limit


@dataclass(frozen=True)
class Hidden:
    """An effect that the description of the arm does not have.

    Attributes
    ----------
    joint : int
    name : str
        As in the catalogue of idloop.
    values : dict of str to float
    """

    joint: int
    name: str
    values: dict[str, float]

    def torque(self, position: float, velocity: float, dry: float) -> float:
        """Torque on the joint [N·m]."""
        v = self.values
        if self.name == "cogging":
            return -v["amplitude"] * math.sin(v["harmonic"] * position + v["phase"])
        if self.name == "asymmetric_viscous_friction":
            return -v["difference"] * abs(velocity)
        if self.name == "quadratic_drag":
            return -v["coefficient"] * velocity * abs(velocity)
        return 0.0

    def level(self, velocity: float, dry: float) -> float:
        """Dry friction of the joint [N·m]."""
        if self.name == "stribeck_friction":
            return dry * (1.0 + self.values["share"] * math.exp(-((velocity / self.values["velocity"]) ** 2)))
        return dry


@dataclass(frozen=True)
class Machine:
    """An arm: parts by which it differs from the MJCF file, and its hidden effects."""

    hidden: tuple[Hidden, ...] = ()
    payload: tuple[float, Array] | None = None  # mass [kg] and centre of mass in the last link [m]
    mass: Array = field(default_factory=lambda: np.ones(6))
    friction: Array = field(default_factory=lambda: np.ones(6))


@dataclass(frozen=True)
class Log:
    """What the drives log: stamps (n,) [s], position, velocity, effort (n, 6)."""

    time: Array
    position: Array
    velocity: Array
    effort: Array


def fourier(seed: int, duration: float, *, harmonics: int = 5, base: float = 0.1) -> Array:
    """Draw a random Fourier reference at the control rate within the limits, shape (samples, 2, 6)."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, duration, _CONTROL)
    reference = np.zeros((len(time), 2, 6))
    for joint in range(6):
        order = np.arange(1, harmonics + 1)
        wave = 2.0 * math.pi * base * order
        a, b = random.normal(size=(2, harmonics)) / order
        angle = np.outer(time, wave)
        q = np.sin(angle) @ a - np.cos(angle) @ b
        v = np.cos(angle) @ (a * wave) + np.sin(angle) @ (b * wave)
        scale = min(0.6 * POSITION_LIMIT[joint] / np.max(np.abs(q)), 0.7 * VELOCITY_LIMIT[joint] / np.max(np.abs(v)))
        reference[:, 0, joint], reference[:, 1, joint] = scale * q, scale * v
    return reference


class Simulation:
    """An arm with its position controller, one control step after the other.

    Parameters
    ----------
    machine : Machine
    position, velocity : array, shape (6,)
        At the beginning [rad, rad/s].
    seed : int
        Of the noise.
    """

    def __init__(self, machine: Machine, position: Array, velocity: Array, seed: int = 0) -> None:
        import mujoco

        self._step = mujoco.mj_step
        self._machine = machine
        self._model = machine_model(machine)
        self._data: Any = mujoco.MjData(self._model)
        self._data.qpos[:], self._data.qvel[:] = position, velocity
        mujoco.mj_forward(self._model, self._data)
        mass = np.zeros((6, 6))
        mujoco.mj_fullM(self._model, self._data, mass)
        self._gain, self._rate_gain = _BANDWIDTH**2 * np.diag(mass), 1.4 * _BANDWIDTH * np.diag(mass)
        self._dry = np.array(self._model.dof_frictionloss)
        self._steps = round(_CONTROL / self._model.opt.timestep)
        self._random = np.random.default_rng(seed)
        self._applied = np.zeros(6)

    def follow(self, position: Array, velocity: Array) -> tuple[Array, Array, Array]:
        """Go one control step towards a set-point (6,).

        Returns
        -------
        position, velocity, effort : array, shape (6,)
            At the beginning of the step, as the drives know them; the effort without noise.
        """
        data, model = self._data, self._model
        measured = np.round(data.qpos / _QUANTUM) * _QUANTUM
        speed = data.qvel + _VELOCITY_NOISE * self._random.normal(size=6)
        wanted = self._gain * (position - measured) + self._rate_gain * (velocity - speed) + data.qfrc_bias
        before, self._applied = self._applied, np.clip(wanted, -EFFORT_LIMIT, EFFORT_LIMIT)
        data.ctrl[:] = self._applied
        for _ in range(self._steps):
            for one in self._machine.hidden:
                place, pace, dry = (float(of[one.joint]) for of in (data.qpos, data.qvel, self._dry))
                data.qfrc_applied[one.joint] = one.torque(place, pace, dry)
                model.dof_frictionloss[one.joint] = one.level(pace, dry)
            self._step(model, data)
        return measured, speed, 0.5 * (before + self._applied)

    def sensed(self, effort: Array) -> Array:
        """Efforts (..., 6) with noise and rounding, as the drives report them."""
        noisy = effort + _EFFORT_NOISE * EFFORT_LIMIT * self._random.normal(size=effort.shape)
        quantum = _EFFORT_QUANTUM * EFFORT_LIMIT
        rounded: Array = np.round(noisy / quantum) * quantum
        return rounded


def run(machine: Machine, reference: Array, *, rate: float = 500.0, seed: int = 0) -> Log:
    """Follow a reference (samples, 2, 6) at the control rate, from its first position and velocity."""
    simulation = Simulation(machine, reference[0, 0], reference[0, 1], seed)
    each = max(round(1.0 / (rate * _CONTROL)), 1)
    rows = [np.concatenate(simulation.follow(*instant)) for instant in reference]
    table = np.array(rows[::each])
    time = np.arange(len(table)) * each * _CONTROL
    return Log(time, table[:, :6], table[:, 6:12], simulation.sensed(table[:, 12:]))


def machine_model(machine: Machine) -> Any:
    """MuJoCo's model of a machine, without its hidden effects."""
    import mujoco

    model: Any = mujoco.MjModel.from_xml_path(str(MJCF))
    model.body_mass[2:] *= machine.mass
    model.body_inertia[2:] *= machine.mass[:, None]
    model.dof_damping[:] *= machine.friction
    model.dof_frictionloss[:] *= machine.friction
    if machine.payload is not None:
        _add_payload(model, *machine.payload)
    return model


def _turn(quaternion: Array) -> Array:
    import mujoco

    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, quaternion)
    return flat.reshape(3, 3)


def _add_payload(model: Any, mass: float, place: Array) -> None:
    """Hang a point mass on the last link."""
    own, com = float(model.body_mass[-1]), np.array(model.body_ipos[-1])
    total = own + mass
    centre = (own * com + mass * place) / total
    import mujoco

    turn = _turn(model.body_iquat[-1])
    inertia = turn @ np.diag(model.body_inertia[-1]) @ turn.T
    for part, at in ((own, com), (mass, place)):
        d = at - centre
        inertia = inertia + part * (d @ d * np.eye(3) - np.outer(d, d))
    values, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    mujoco.mju_mat2Quat(model.body_iquat[-1], axes.ravel())
    model.body_mass[-1], model.body_ipos[-1], model.body_inertia[-1] = total, centre, values


def hide(names: Sequence[str], joints: Sequence[int], random: np.random.Generator) -> tuple[Hidden, ...]:
    """Draw effects of some kinds at some joints, each clear of the noise and small beside the whole torque."""
    found = []
    scale = np.array([5.0, 6.0, 3.0, 0.9, 0.8, 0.5])
    for name, joint in zip(names, joints, strict=True):
        size = float(scale[joint])
        values = {
            "cogging": {
                "amplitude": size * random.uniform(0.3, 0.8),
                "harmonic": float(random.integers(6, 14)),
                "phase": random.uniform(-3.0, 3.0),
            },
            "stribeck_friction": {"share": random.uniform(0.5, 1.2), "velocity": random.uniform(0.08, 0.2)},
            "asymmetric_viscous_friction": {"difference": size * random.uniform(0.3, 0.6)},
            "quadratic_drag": {"coefficient": size * random.uniform(0.3, 0.6)},
        }[name]
        found.append(Hidden(joint, name, values))
    return tuple(found)


def true_parameters(machine: Machine) -> tuple[Array, Array]:
    """Parameters of a machine without payload as `idloop.robots` has them.

    Returns
    -------
    links : array, shape (6, 10)
        Mass, first moments, inertia about the joint's frame (xx, xy, yy, xz, yz, zz).
    own : array, shape (6, 4)
        Armature, viscous and Coulomb friction, offset.
    """
    return parameters_of(machine_model(machine))


def parameters_of(model: Any) -> tuple[Array, Array]:
    """Parameters of a model of MuJoCo, as of `true_parameters`."""
    links = np.zeros((6, 10))
    for joint in range(6):
        body = joint + 2
        mass, centre = float(model.body_mass[body]), np.array(model.body_ipos[body])
        turn = _turn(model.body_iquat[body])
        inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
        inertia += mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        links[joint] = [mass, *(mass * centre), *inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]]
    own = np.column_stack([model.dof_armature, model.dof_damping, model.dof_frictionloss, np.zeros(6)])
    return links, own
