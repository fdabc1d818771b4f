"""Identification of a whole robot: rigid bodies, then every joint, and both once more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.diagnosis import Ladder, Step
from idloop.diagnosis.search.step import NOT_EXCITED
from idloop.physics.model import Model
from idloop.robots.balance import Balance, RobotMotion, balance_of, robot_motions
from idloop.robots.joint_models import (
    JointTask,
    effect_torque,
    joint_tasks,
    own_inertia,
    proportional,
    refine_joints,
    unchanged,
)
from idloop.robots.joint_records import JointRecord
from idloop.robots.rigid_body import RigidBody
from idloop.robots.rigid_fit import EFFECTS, RigidFit, fit_rigid

Report = Callable[[float, str], None]

# Part of the torque of effects that no other parameter of the joint explains, for its size to be estimated beside them.
_OWN = 0.1
# A joint that is held by friction for more than the rest of its time says nothing about itself.
_LEAST_MOTION = 0.05


@dataclass(frozen=True)
class TorqueError:
    """Error of the modelled torque along one record, in the comparison band and where the joint moves."""

    record: str
    unseen: bool
    # shape (joints,): of the error and of the measured torque about its mean [N·m or N]; NaN for a joint that never
    # moves
    rms: Array
    torque: Array
    rigid: Array  # shape (joints,): Rms error without the effects that were found
    time: Array  # shape (rows,): [s]
    # shape (rows, joints): torque, and what is left of it; NaN where dry friction holds the joint [N·m or N]
    measured: Array
    error: Array

    @property
    def relative(self) -> Array:
        """Error over torque, shape (joints,)."""
        return self.rms / np.maximum(self.torque, 1e-300)


@dataclass(frozen=True)
class Robot:
    """An identified robot. Its torque is that of `fit` plus that of the effects of the ladders."""

    rigid_body: RigidBody
    fit: RigidFit  # links and joints, with the torque of the effects subtracted
    start: RigidFit  # the first fit, without them
    ladders: tuple[Ladder, ...]  # one for each joint
    tasks: tuple[JointTask, ...]  # records of each joint
    balances: tuple[Balance, ...]  # of the fitted records
    errors: tuple[TorqueError, ...]

    @property
    def resting(self) -> list[int]:
        """Places of the joints that friction holds in all fitted records."""
        moved = np.any(np.concatenate([one.used for one in self.balances]), axis=0)
        return [int(place) for place in np.flatnonzero(~moved)]

    def models(self) -> list[Model]:
        """Model of every joint as an axis, with the values of the last fit of all joints together.

        That fit is along the whole motion of the arm and leaves out where dry friction holds a joint; what the effects
        of a ladder have themselves is as the ladder has it.
        """
        errors = {one.name: one.stderr for one in self.fit.base}
        found = []
        for place, (joint, ladder) in enumerate(zip(self.rigid_body.joints, self.ladders, strict=True)):
            armature, viscous, dry, offset = self.fit.own[place].tolist()
            given = {
                f"{joint}.inertia": (self.tasks[place].inertia + armature, None),
                f"{joint}.viscous_friction": (max(viscous, 0.0), errors.get(f"{joint}.viscous")),
                f"coulomb_friction@{joint}.level": (max(dry, 0.0), errors.get(f"{joint}.coulomb")),
                f"load_torque@{joint}.torque": (offset, errors.get(f"{joint}.offset")),
            }
            known = {name: pair for name, pair in given.items() if name in ladder.model.free}
            for active in ladder.model.effects:
                if active.name in ladder.added and proportional(ladder):
                    first = f"{active.name}.{active.effect.parameters[0].name}"
                    bounds = ladder.model.parameter(first)
                    value = ladder.model.values[first] * float(self.fit.scales[place])
                    spread = errors.get(f"{joint}.{EFFECTS}")
                    error = None if spread is None else abs(ladder.model.values[first]) * spread
                    known[first] = (min(max(value, bounds.min), bounds.max), error)
            stderr = {name: error for name, (_, error) in known.items() if error is not None}
            found.append(ladder.model.with_values({name: value for name, (value, _) in known.items()}, stderr))
        return found

    def effects(self, motion: RobotMotion) -> Array:
        """Torque of the effects that were found, along a motion, shape (n, joints) [N·m or N]."""
        return _effects(self.ladders, motion) * self.fit.scales


def _effects(ladders: Sequence[Ladder], motion: RobotMotion) -> Array:
    return np.column_stack([effect_torque(one, motion, place) for place, one in enumerate(ladders)])


def identify(
    robot: RigidBody,
    records: Sequence[JointRecord],
    validation: Sequence[JointRecord],
    *,
    level: float,
    rounds: int,
    workers: int,
    seed: int,
    report: Report,
) -> Robot:
    """Fit the rigid bodies, refine every joint, and repeat with the torques of the found effects subtracted."""
    report(0.0, "smoothing the motion")
    every = robot_motions([*records, *validation], [one == "prismatic" for one in robot.types])
    balances = [balance_of(robot, one) for one in every]
    share = np.mean(np.concatenate([one.used for one in balances[: len(records)]]), axis=0)
    resting = np.flatnonzero(share < _LEAST_MOTION).tolist()
    if resting:
        balances = [one.at_rest(resting) for one in balances]
    motions, unseen = every[: len(records)], every[len(records) :]
    fit = start = fit_rigid(robot.joints, balances[: len(records)], robot.nominal)
    tasks: list[JointTask] = []
    ladders: list[Ladder] = []
    for number in range(rounds):
        inertia = own_inertia(robot, fit.links, motions)
        anew = joint_tasks(robot, fit, inertia, motions, unseen, level, seed)
        changed = [
            place
            for place, task in enumerate(anew)
            if place not in resting
            and (not tasks or not unchanged(tasks[place], task, motions, place, float(fit.sigma[place])))
        ]
        if not changed:
            break
        done = 0.05 + 0.9 * number / rounds

        def within(share: float, text: str, done: float = done) -> None:
            report(done + 0.9 / rounds * share, f"joint {text}")

        climbed = refine_joints([anew[place] for place in changed], workers, within)
        tasks = tasks or anew
        ladders = ladders or [Ladder((Step(None, one.model),), NOT_EXCITED, level=one.level) for one in tasks]
        for place, ladder in zip(changed, climbed, strict=True):
            tasks[place], ladders[place] = anew[place], ladder
        if not any(one.added for one in ladders):
            break
        fit = _refit(robot, balances[: len(records)], ladders)
    report(0.97, "comparing torques")
    errors = [
        torque_error(one, start, fit, ladders, unseen=place >= len(records)) for place, one in enumerate(balances)
    ]
    return Robot(robot, fit, start, tuple(ladders), tuple(tasks), tuple(balances[: len(records)]), tuple(errors))


def _refit(robot: RigidBody, balances: Sequence[Balance], ladders: Sequence[Ladder]) -> RigidFit:
    """Fit rigid bodies and joints with the torque of the effects subtracted, and its size where that is one number."""
    torques = [_effects(ladders, one.motion) for one in balances]
    motions = [one.motion for one in balances]
    scaled = [place for place, one in enumerate(ladders) if proportional(one) and _is_own(torques, motions, place)]
    left = []
    for one, known in zip(balances, torques, strict=True):
        columns = np.zeros((*known.shape, len(scaled)))
        for number, place in enumerate(scaled):
            columns[:, place, number] = known[:, place]
        left.append(one.without(known).with_columns(columns) if scaled else one.without(known))
    return fit_rigid(robot.joints, left, robot.nominal, scaled)


def _is_own(torques: Sequence[Array], motions: Sequence[RobotMotion], place: int) -> bool:
    """Whether the torque of a joint's effects is more than another friction, offset and inertia along the motion."""
    torque = np.concatenate([one[:, place] for one in torques])
    v, a = (np.concatenate([getattr(one, key)[:, place] for one in motions]) for key in ("velocity", "acceleration"))
    plain = np.column_stack([a, v, np.sign(v), np.ones_like(v)])
    rest = torque - plain @ np.linalg.lstsq(plain, torque, rcond=None)[0]
    return bool(np.mean(rest**2) > _OWN**2 * np.mean(torque**2))


def torque_error(
    balance: Balance, start: RigidFit, fit: RigidFit, ladders: Sequence[Ladder], *, unseen: bool
) -> TorqueError:
    """Compare the modelled torque with the measured one along a motion, with and without the effects."""
    error = balance.without(_effects(ladders, balance.motion) * fit.scales).error(fit.parameters)
    torque = _rms(balance.torque, balance, centred=True)
    rigid = _rms(balance.error(start.parameters), balance)
    shown = [np.where(balance.used, one, np.nan) for one in (balance.torque, error)]
    name = balance.motion.record.name
    return TorqueError(name, unseen, _rms(error, balance), torque, rigid, balance.time, shown[0], shown[1])


def _rms(values: Array, balance: Balance, *, centred: bool = False) -> Array:
    """Rms of each joint's rows in motion, shape (joints,); NaN without any."""
    found = []
    for column, used in zip(values.T, balance.used.T, strict=True):
        own = column[used]
        found.append(float(np.sqrt(np.mean((own - (np.mean(own) if centred else 0.0)) ** 2))) if len(own) else np.nan)
    return np.array(found)
