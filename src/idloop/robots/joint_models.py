"""Every joint of a robot as an axis of its own: the effort that is left for it, its ladder, and its torque.

What the links, gravity and the other joints do is subtracted from a joint's measured effort; left is a body of constant
inertia, the mean of the joint's own, with friction and whatever else the joint has.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from idloop.arrays import Array
from idloop.diagnosis import Ladder, refine
from idloop.diagnosis.options import MINIMUM_IMPROVEMENT
from idloop.estimation.force_balance.motion import low_pass
from idloop.physics.effect import BODY, OUTPUT, catalogue
from idloop.physics.engine import Engine
from idloop.physics.model import Model
from idloop.records.record import Record
from idloop.robots.balance import RobotMotion
from idloop.robots.joint_records import axis_model
from idloop.robots.rigid_body import RigidBody
from idloop.robots.rigid_fit import RigidFit
from idloop.worker_process import WorkerProcess

Report = Callable[[float, str], None]

_MEAN_OVER = 500  # configurations over which a joint's own inertia is averaged
# What the weight of the links does, which the rigid bodies have already: at a joint it would be taken for their error.
_OF_LINKS = ("gravity", "imbalance")
_RATE = 8.0  # of a joint's record, as a multiple of the motion's cut-off
_LEAST = 1e-6  # of start values of a fit


@dataclass(frozen=True)
class JointTask:
    """What one joint's ladder is climbed from; travels to another process."""

    model: Model  # inertia, viscous and Coulomb friction, constant torque
    # With the effort that is left for the joint
    records: tuple[Record, ...]
    validation: tuple[Record, ...]
    inertia: float  # mean own inertia of the links, which the model has besides the armature [kg·m² or kg]
    level: float  # family-wise error rate of every step of this joint
    seed: int


def effects_of_joints() -> tuple[str, ...]:
    """Names of the effects that a joint with a measured effort can show.

    The effort is measured behind the drive: what limits, delays or distorts a command has acted already. Effects of a
    condition, such as a temperature, need its record, and the weight of the links is that of the rigid bodies.
    """
    return tuple(
        name
        for name, several in catalogue().items()
        if name not in _OF_LINKS and any(one.site in {BODY, OUTPUT} and not one.condition for one in several)
    )


def own_inertia(robot: RigidBody, links: Array, motions: Sequence[RobotMotion]) -> Array:
    """Mean of the diagonal of the mass matrix over the motions, shape (joints,) [kg·m² or kg]."""
    position = np.concatenate([one.position for one in motions])
    some = position[:: max(len(position) // _MEAN_OVER, 1)]
    return np.asarray(np.mean(robot.own_inertia(links.ravel(), some), axis=0))


def others_torque(robot: RigidBody, links: Array, inertia: Array, motion: RobotMotion) -> Array:
    """Torque of links, gravity and the other joints along a motion, without the mean own inertia, (n, joints)."""
    whole = robot.torque(links.ravel(), motion.position, motion.velocity, motion.acceleration)
    return np.asarray(whole - inertia * motion.acceleration)


def joint_tasks(
    robot: RigidBody,
    fit: RigidFit,
    inertia: Array,
    motions: Sequence[RobotMotion],
    unseen: Sequence[RobotMotion],
    level: float,
    seed: int,
) -> list[JointTask]:
    """Make the task of every joint; the level is divided by the number of joints (Bonferroni)."""
    left = [one.record.effort - others_torque(robot, fit.links, inertia, one) for one in (*motions, *unseen)]
    tasks = []
    for place, name in enumerate(robot.joints):
        armature, viscous, dry, constant = fit.own[place]
        model = axis_model(
            name, prismatic=robot.types[place] == "prismatic", inertia=max(inertia[place] + armature, _LEAST),
            viscous=max(viscous, _LEAST), dry=max(dry, _LEAST), constant=constant,
        )  # fmt: skip
        records = [
            _thinned_axis(one, place, model, effort[:, place])
            for one, effort in zip((*motions, *unseen), left, strict=True)
        ]
        fitted, rest = records[: len(motions)], records[len(motions) :]
        own = float(inertia[place])
        tasks.append(JointTask(model, tuple(fitted), tuple(rest), own, level / len(robot.joints), seed))
    return tasks


def _stride(motion: RobotMotion) -> int:
    return max(int(1.0 / (_RATE * motion.cutoff * motion.record.sample_time)), 1)


def _thinned_axis(motion: RobotMotion, place: int, model: Model, effort: Array) -> Record:
    """Record of a joint at a rate that resolves its motion; what a fit takes longer for shows nothing more."""
    record, stride = motion.record, _stride(motion)
    smooth = low_pass(effort, 0.4 / (stride * record.sample_time), record.sample_time) if stride > 1 else effort
    fields = ("time", "position", "velocity", "effort")
    kept = replace(record, **{key: getattr(record, key)[::stride] for key in fields})
    return kept.axis(place, model, np.ascontiguousarray(smooth[::stride]))


def unchanged(before: JointTask, after: JointTask, motions: Sequence[RobotMotion], place: int, sigma: float) -> bool:
    """Whether a new rigid-body fit leaves a joint the same effort.

    Inertia, viscous friction and constant torque of its model are free, and a change of the rest that is small beside
    the residual can neither make nor break an effect that reduces the errors by the least improvement.
    """
    rows, changes = [], []
    for one, old, new in zip(motions, before.records, after.records, strict=True):
        stride = _stride(one)
        rows.append(np.column_stack([one.acceleration[::stride, place], one.velocity[::stride, place]]))
        changes.append(new.input - old.input)
    table, change = np.concatenate(rows), np.concatenate(changes)
    table = np.column_stack([table, np.ones(len(table))])
    rest = change - table @ np.linalg.lstsq(table, change, rcond=None)[0]
    return bool(np.mean(rest**2) < MINIMUM_IMPROVEMENT * sigma**2)


def refine_joint(task: JointTask, report: Report) -> Ladder:
    """Climb the ladder of one joint by the force balance."""
    return refine(
        task.model, task.records, task.validation, level=task.level, criterion="force",
        effects=effects_of_joints(), seed=task.seed, progress=report,
    )  # fmt: skip


def refine_joints(tasks: Sequence[JointTask], workers: int, report: Report) -> list[Ladder]:
    """Climb the ladders of all joints, each in one of so many processes; 0: in this one."""
    shares = [0.0] * len(tasks)
    lock = threading.Lock()

    def tell(place: int, share: float) -> None:
        with lock:
            shares[place] = share
            report(sum(shares) / len(shares), tasks[place].model.name)

    if workers == 0:
        found = []
        for place, task in enumerate(tasks):
            found.append(refine_joint(task, partial(_of_joint, tell, place)))
            tell(place, 1.0)
        return found
    pool = [WorkerProcess("idloop joint", yields=False) for _ in range(min(workers, len(tasks)))]
    free = list(pool)

    def run(place: int) -> Ladder:
        with lock:
            worker = free.pop()
        try:
            ladder: Ladder = worker.call(refine_joint, tasks[place], report=partial(_of_joint, tell, place))
        finally:
            with lock:
                free.append(worker)
        tell(place, 1.0)
        return ladder

    try:
        with ThreadPoolExecutor(len(pool)) as threads:
            return list(threads.map(run, range(len(tasks))))
    finally:
        for worker in pool:
            worker.close()


def _of_joint(tell: Callable[[int, float], None], place: int, share: float, text: str) -> None:
    tell(place, share)


def joint_torque(model: Model, motion: RobotMotion, place: int) -> Array:
    """Torque that a joint's model needs along a motion, shape (n,) [N·m or N].

    Its dry friction opposes the slowest motion: what it balances at rest is no torque of the joint alone.
    """
    q, v, a = (getattr(motion, key)[:, place : place + 1] for key in ("position", "velocity", "acceleration"))
    time = motion.record.time
    balance = Engine(model).balance(None, q, v, a, time, np.zeros(len(time)), time)
    return np.asarray(balance.required)


def proportional(ladder: Ladder) -> bool:
    """Whether a ladder added effects, and the torque of all of them is proportional to their first parameter."""
    active = [one for one in ladder.model.effects if one.name in ladder.added]
    return bool(active) and all(one.effect.proportional for one in active)


def effect_torque(ladder: Ladder, motion: RobotMotion, place: int) -> Array:
    """Torque of the effects that a ladder has added, along a motion, shape (n,); 0 where it added none."""
    if not ladder.added:
        return np.zeros(len(motion.record.time))
    model = ladder.model
    without = model.without_effects(ladder.added)
    return joint_torque(model, motion, place) - joint_torque(without, motion, place)
