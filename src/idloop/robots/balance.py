"""Torque balance of all joints along measured motions, band-limited, linear in its parameters.

Positions are low-passed without phase and differentiated, and the measured torque and every column of the regressor
pass one and the same low-pass filter before they are decimated (Gautier, Janot and Vandanjon, IEEE Trans. Control
Systems Technology 21, 2013). A weak form like that of a single axis would need the regressor of Cᵀ(q, q̇) q̇, which
Pinocchio does not compute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from idloop.arrays import Array, Mask
from idloop.errors import InputError
from idloop.estimation.force_balance.motion import Motion, low_pass, measured_motion
from idloop.robots.joint_records import JointRecord, axis_model
from idloop.robots.rigid_body import PER_LINK, RigidBody

# What every joint has beside its link.
OF_JOINT = ("armature", "viscous", "coulomb", "offset")
# The regressor is evaluated at this rate, as a multiple of the motion's cut-off: products of motions are wider.
_EVALUATED = 10.0
# Rows as a multiple of the comparison band.
_ROWS = 2.5
_KEYS = ("position", "velocity", "acceleration")
_MOST_REST = 0.02  # share of rest within a row that is used


@dataclass(frozen=True)
class RobotMotion:
    """Smoothed motion of all joints along a record."""

    record: JointRecord
    # shape (n, joints): at the record's own rate
    position: Array
    velocity: Array
    acceleration: Array
    rest_speed: Array  # shape (joints,)
    # Of the motion, and of the comparison of torques [Hz]
    cutoff: float
    band: float


def robot_motions(records: Sequence[JointRecord], prismatic: Sequence[bool]) -> list[RobotMotion]:
    """Smooth the motions of all records with one cut-off, that of the fastest joint.

    Raises InputError: no joint moves, or a record is too short.
    """
    models = [axis_model(name, prismatic=one) for name, one in zip(records[0].joints, prismatic, strict=True)]
    moving = [
        place
        for place in range(len(models))
        if any(np.ptp(record.position[:, place]) > 1e-6 * (1.0 + abs(record.position[0, place])) for record in records)
    ]
    if not moving:
        raise InputError(f"{records[0].name}: no joint moves; record a motion of all joints")

    def motion(record: JointRecord, place: int, cutoff: float | None) -> Motion:
        found = measured_motion(models[place], record.axis(place, models[place]), cutoff)
        if found is None:
            raise InputError(f"{record.name}: {len(record.time)} samples are too few; record for longer")
        return found

    cutoff = max(motion(record, place, None).cutoff for record in records for place in moving)
    found = []
    for record in records:
        motions = [motion(record, place, cutoff) for place in range(len(models))]
        q, v, a = (np.column_stack([getattr(one, key)[:, 0] for one in motions]) for key in _KEYS)
        rest_speed = np.array([float(one.rest_speed[0]) for one in motions])
        found.append(RobotMotion(record, q, v, a, rest_speed, cutoff, min(one.comparison_band for one in motions)))
    return found


@dataclass(frozen=True)
class Balance:
    """Rows of the balance of one record."""

    motion: RobotMotion
    time: Array  # shape (rows,): [s]
    regressor: Array  # shape (rows, joints, parameters): parameters: ten of each link, then `OF_JOINT` of each joint
    torque: Array  # shape (rows, joints): measured, less what was subtracted [N·m or N]
    used: Mask  # shape (rows, joints): False where dry friction holds the joint: it is then not known

    def without(self, known: Array) -> Balance:
        """The balance with a torque (n, joints) along the motion subtracted from the measured one."""
        return replace(self, torque=_torque_rows(self.motion, self.motion.record.effort - known))

    def at_rest(self, joints: Sequence[int]) -> Balance:
        """The balance without the rows and the own parameters of joints that friction holds."""
        regressor, used = self.regressor.copy(), self.used.copy()
        first = PER_LINK * used.shape[1]
        for joint in joints:
            used[:, joint] = False
            regressor[:, :, first + len(OF_JOINT) * joint : first + len(OF_JOINT) * (joint + 1)] = 0.0
        return replace(self, regressor=regressor, used=used)

    def with_columns(self, torques: Array) -> Balance:
        """The balance with further parameters: factors of torques (n, joints, k) along the motion."""
        rows = [_torque_rows(self.motion, np.ascontiguousarray(one)) for one in np.moveaxis(torques, -1, 0)]
        return replace(self, regressor=np.concatenate([self.regressor, *(one[:, :, None] for one in rows)], axis=2))

    def less(self, parameters: Array) -> Balance:
        """The balance with the torque of parameters subtracted."""
        return replace(self, torque=self.error(parameters))

    def error(self, parameters: Array) -> Array:
        """Torque that parameters leave unexplained, shape (rows, joints)."""
        return np.asarray(self.torque - self.regressor @ parameters)


def balance_of(robot: RigidBody, motion: RobotMotion) -> Balance:
    """Evaluate the balance of a robot along a motion."""
    step, factor, rows = _grid(motion)
    q, v, a = (getattr(motion, key)[::factor] for key in _KEYS)
    slow = np.maximum(motion.rest_speed, 1e-9)
    joints = len(robot.joints)
    regressor = np.zeros((len(q), joints, (PER_LINK + len(OF_JOINT)) * joints))
    regressor[:, :, : PER_LINK * joints] = robot.regressor(q, v, a)
    own = np.stack([a, v, np.clip(v / slow, -1.0, 1.0), np.ones_like(v)], axis=-1)
    for joint in range(joints):
        first = PER_LINK * joints + len(OF_JOINT) * joint
        regressor[:, joint, first : first + len(OF_JOINT)] = own[:, joint]
    columns = regressor.reshape(len(q), -1)
    # Most are zero: friction of other joints, and links that a joint does not carry.
    shown = np.flatnonzero(np.any(columns, axis=0))
    table = np.zeros((len(columns[rows]), columns.shape[1]))
    table[:, shown] = low_pass(columns[:, shown], motion.band, step)[rows]
    resting = low_pass((np.abs(v) < slow).astype(float), motion.band, step)[rows]
    time, torque = motion.record.time[::factor][rows], _torque_rows(motion, motion.record.effort)
    return Balance(motion, time, table.reshape(-1, *regressor.shape[1:]), torque, resting < _MOST_REST)


def _grid(motion: RobotMotion) -> tuple[float, int, slice]:
    """Step [s] at which the regressor is evaluated, as a number of samples, and which of these become rows."""
    sample_time = motion.record.sample_time
    factor = max(int(1.0 / (_EVALUATED * motion.cutoff * sample_time)), 1)
    step = factor * sample_time
    count = -(-len(motion.record.time) // factor)
    edge = min(int(np.ceil(2.0 / (motion.band * step))), count // 10)
    return step, factor, slice(edge, count - edge, max(int(1.0 / (_ROWS * motion.band * step)), 1))


def _torque_rows(motion: RobotMotion, torque: Array) -> Array:
    """Filter a torque (n, joints) as the regressor is filtered."""
    step, factor, rows = _grid(motion)
    evaluated = low_pass(torque, 0.25 * _EVALUATED * motion.cutoff, motion.record.sample_time)[::factor]
    return low_pass(np.ascontiguousarray(evaluated), motion.band, step)[rows]


def parameter_names(joints: Sequence[str]) -> list[str]:
    """Names of all parameters, such as ``elbow.mass`` or ``elbow.coulomb``."""
    links = ("mass", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz")
    return [f"{joint}.{key}" for keys in (links, OF_JOINT) for joint in joints for key in keys]
