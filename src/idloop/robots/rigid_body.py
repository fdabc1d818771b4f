"""Rigid-body dynamics of a URDF, linear in its inertial parameters, by Pinocchio."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.spelling import did_you_mean, listed

PER_LINK = 10  # mass, first moments (x, y, z), and inertia (xx, xy, yy, xz, yz, zz) about the joint's frame


def load_pinocchio() -> ModuleType:
    """Import Pinocchio; InputError says how to install it."""
    try:
        import pinocchio
    except ImportError as error:
        raise InputError("Pinocchio is not installed, which robots need: pip install 'idloop[robot]'") from error
    module: ModuleType = pinocchio
    return module


class RigidBody:
    """Torques of a tree of links along a motion.

    Links behind joints that are not among ``joints`` are rigid with the link before them, in the joint's zero position.

    `urdf`: file. `joints`: joints in the wanted order; all movable joints of the file, in its order, when left out.
    `types`: ``revolute``, ``continuous`` or ``prismatic``. `nominal` (10 joints,): inertial parameters by the URDF, ten
    for each joint's link in the order of ``joints``: mass [kg], first moments [kg·m], inertia about the joint's frame
    (xx, xy, yy, xz, yz, zz) [kg·m²]. Raises InputError: Pinocchio is not installed, the file is no URDF, or it lacks a
    joint.
    """

    def __init__(self, urdf: Path | str, joints: Sequence[str] | None = None) -> None:
        pinocchio = load_pinocchio()
        self.path = Path(urdf)
        text = read_urdf(self.path)
        try:
            model = pinocchio.buildModelFromXML(text)
        except Exception as error:
            raise InputError(f"{urdf}: Pinocchio refuses it: {' '.join(str(error).split())}") from error
        movable = [model.names[i] for i in range(1, model.njoints) if model.joints[i].nv == 1]
        wanted = tuple(movable if joints is None else joints)
        for name in wanted:
            if name not in movable:
                known = f"it has {listed(movable)}{did_you_mean(name, movable)}"
                raise InputError(f"{urdf}: no movable joint {name!r}; {known}")
        if not wanted:
            raise InputError(f"{urdf}: no movable joint; a robot needs one at least")
        locked = [model.getJointId(name) for name in model.names[1:] if name not in wanted]
        if locked:
            model = pinocchio.buildReducedModel(model, locked, pinocchio.neutral(model))
        self.joints = wanted
        self._pin: Any = pinocchio
        self._model: Any = model
        self._data: Any = model.createData()
        ids = [model.getJointId(name) for name in wanted]
        self._nv = np.array([model.joints[i].idx_v for i in ids])
        self._nq = np.array([model.joints[i].idx_q for i in ids])
        self._turns = np.array([model.joints[i].nq == 2 for i in ids])
        self._columns = np.concatenate([np.arange(PER_LINK) + PER_LINK * (i - 1) for i in ids])
        self.types = tuple(
            "continuous" if turn else "prismatic" if name.startswith("JointModelP") else "revolute"
            for turn, name in zip(self._turns, (model.joints[i].shortname() for i in ids), strict=True)
        )
        self.nominal: Array = np.concatenate([model.inertias[i].toDynamicParameters() for i in ids])
        self.limits = self._limits()

    def _limits(self) -> dict[str, Array]:
        model = self._model
        lower = np.where(self._turns, -np.inf, model.lowerPositionLimit[self._nq])
        upper = np.where(self._turns, np.inf, model.upperPositionLimit[self._nq])
        bounded = upper > lower
        return {
            "lower": np.where(bounded, lower, -np.inf),
            "upper": np.where(bounded, upper, np.inf),
            "velocity": _positive(model.velocityLimit[self._nv]),
            "effort": _positive(model.effortLimit[self._nv]),
        }

    def pinocchio_model(self) -> Any:
        """Pinocchio's model of the joints."""
        return self._model

    def configuration(self, position: Array) -> Array:
        """Pinocchio's configuration of joint positions (joints,)."""
        q = np.empty(self._model.nq)
        q[self._nq] = np.where(self._turns, np.cos(position), position)
        q[self._nq[self._turns] + 1] = np.sin(position[self._turns])
        return q

    def regressor(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Torque of every joint by inertial parameter, shape (n, joints, 10 joints).

        Atkeson, An and Hollerbach (Int. J. Robotics Research 5, 1986): the torque is linear in mass, first moments and
        inertia about the joint's frame.

        `position`, `velocity`, `acceleration` (n, joints).
        """
        found = np.empty((len(position), len(self.joints), len(self._columns)))
        pick = np.ix_(self._nv, self._columns)
        for k, (q, v, a) in enumerate(self._states(position, velocity, acceleration)):
            table = self._pin.computeJointTorqueRegressor(self._model, self._data, q, v, a)
            found[k] = np.atleast_2d(table)[pick]  # a vector for a single joint
        return found

    def torque(self, parameters: Array, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Torque of every joint by recursive Newton-Euler, shape (n, joints) [N·m or N].

        `parameters` (10 joints,). `position`, `velocity`, `acceleration` (n, joints).
        """
        model, data = self._with(parameters)
        states = self._states(position, velocity, acceleration)
        return np.array([self._pin.rnea(model, data, q, v, a)[self._nv] for q, v, a in states])

    def own_inertia(self, parameters: Array, position: Array) -> Array:
        """Diagonal of the mass matrix, shape (n, joints) [kg·m² or kg]."""
        model, data = self._with(parameters)
        masses = (self._pin.crba(model, data, self.configuration(one)) for one in position)
        return np.array([np.diag(mass)[self._nv] for mass in masses])

    def _states(self, *motion: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Configuration, velocity and acceleration in the order of Pinocchio at each instant."""
        v, a = np.zeros(self._model.nv), np.zeros(self._model.nv)
        for position, velocity, acceleration in zip(*motion, strict=True):
            v[self._nv], a[self._nv] = velocity, acceleration
            yield self.configuration(position), v, a

    def _with(self, parameters: Array) -> tuple[Any, Any]:
        model = self._model.copy()
        for place, name in enumerate(self.joints):
            own = parameters[PER_LINK * place : PER_LINK * (place + 1)]
            model.inertias[model.getJointId(name)] = self._pin.Inertia.FromDynamicParameters(own)
        return model, model.createData()


def _positive(limit: Array) -> Array:
    """A limit of 0, which a URDF without one has, is none."""
    return np.where(limit > 0.0, limit, np.inf)


def read_urdf(path: Path) -> str:
    """Text of a URDF; InputError where it is none."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a URDF: check the path") from error
    if "<robot" not in text:
        raise InputError(f"{path}: no <robot> in it; give a URDF (of a xacro file: xacro FILE > robot.urdf)")
    return text
