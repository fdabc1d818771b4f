"""A whole robot from its URDF and its JointState bags: links, joints, and what each joint lacks."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.api.data import paths_of
from idloop.api.ladder import Ladder
from idloop.api.result import Progress, Result, ignore_progress
from idloop.api.single_thread import single_threaded
from idloop.diagnosis.options import Options
from idloop.errors import InputError
from idloop.json_values import to_json
from idloop.output_files import write_text
from idloop.reporting.text.blocks import Block
from idloop.robots.balance import balance_of, robot_motions
from idloop.robots.document import document
from idloop.robots.figures import plot_robot
from idloop.robots.identified_urdf import identified_urdf
from idloop.robots.identify import identify
from idloop.robots.joint_records import read_joints
from idloop.robots.rigid_body import RigidBody, read_urdf
from idloop.robots.rigid_fit import fit_payload
from idloop.robots.words import robot_blocks
from idloop.spelling import check_known

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.physics import Model
    from idloop.robots.identify import Robot
    from idloop.robots.rigid_fit import Payload


@dataclass(frozen=True)
class RobotIdentification(Result):
    """An identified robot.

    Attributes
    ----------
    robot : idloop.robots.identify.Robot
        Links, joints, their ladders, torque errors.
    payload : idloop.robots.rigid_fit.Payload or None
        Body at the last link, where records with it were given.
    findings : tuple of str
        What was noticed while reading.
    """

    robot: Robot
    payload: Payload | None = None
    findings: tuple[str, ...] = ()

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the URDF."""
        return self.robot.rigid_body.joints

    @property
    def models(self) -> dict[str, Model]:
        """Model of every joint as an axis, fitted, by its name; its input is the effort that is left for the joint."""
        return dict(zip(self.joints, self.robot.models(), strict=True))

    @property
    def added(self) -> dict[str, tuple[str, ...]]:
        """Effects that were found, by joint."""
        return {name: one.added for name, one in zip(self.joints, self.robot.ladders, strict=True)}

    def ladder(self, joint: str) -> Ladder:
        """Return the ladder of one joint, for `idloop.suggest`, a report or further effects.

        Raises
        ------
        InputError
            No such joint.
        """
        check_known(joint, self.joints, "no joint")
        place = self.joints.index(joint)
        task = self.robot.tasks[place]
        return Ladder(self.robot.ladders[place], task.records, task.validation)

    def blocks(self) -> Iterator[Block]:
        """Yield the table of joints, what each lacks, the rigid bodies and the payload."""
        yield from robot_blocks(self.to_dict())

    def plot(self) -> Figure:
        """Draw measured and modelled torque of every joint, on the last record."""
        return plot_robot(self.robot)

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/robot/1``."""
        return document(self.robot, self.payload, self.findings)

    def urdf(self) -> str:
        """Return the URDF with the identified inertias, damping and friction."""
        links = dict(zip(self.joints, self.robot.fit.links, strict=True))
        return identified_urdf(read_urdf(self.robot.rigid_body.path), links, self.models)

    def report(self, path: str | Path) -> Path:
        """Write the report: one HTML page that loads nothing from elsewhere."""
        from idloop.robots.page import render_robot

        write_text(Path(path), render_robot(self.robot, self.to_dict()))
        return Path(path)

    def save(self, folder: str | Path) -> Path:
        """Write robot.json, robot.urdf, report.html, and the model of every joint in the folder ``joints``."""
        import json

        target = Path(folder)
        (target / "joints").mkdir(parents=True, exist_ok=True)
        write_text(target / "robot.json", json.dumps(to_json(self.to_dict()), indent=2, ensure_ascii=False) + "\n")
        write_text(target / "robot.urdf", self.urdf())
        for name, model in self.models.items():
            write_text(target / "joints" / f"{name}.yaml", model.to_yaml())
        self.report(target / "report.html")
        return target


@single_threaded
def identify_robot(
    urdf: str | Path,
    bags: str | Path | Iterable[str | Path],
    validate: str | Path | Iterable[str | Path] = (),
    *,
    payload: str | Path | Iterable[str | Path] = (),
    topic: str = "joint_states",
    level: float = 0.01,
    rounds: int = 2,
    workers: int | None = 0,
    seed: int = 0,
    progress: Progress = ignore_progress,
) -> RobotIdentification:
    """Identify the rigid bodies of a robot and every joint of it, and find the effects that each joint lacks.

    Parameters
    ----------
    urdf : str or Path
        Description of the robot. Its inertias are kept where the records say nothing.
    bags : path or iterable of path
        With position and measured effort of the joints, in any order; joints may be missing now and then.
    validate : path or iterable of path, optional
        What judges the torque without being fitted.
    payload : path or iterable of path, optional
        The same robot with a body at its last link, which is estimated.
    topic : str
        Of the JointState messages.
    level : float
        Probability of naming an effect at any joint where none is missing; each joint gets its part of it.
    rounds : int
        How often rigid bodies and joints are fitted in turn; later rounds know the effects found before.
    workers : int, optional
        Processes for the joints; None: one for each core, 0: none. A script that starts processes needs
        ``if __name__ == "__main__":`` around its work.
    seed : int
        Equal seeds give equal answers.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Raises
    ------
    InputError
        Pinocchio is not installed, files that cannot be read or do not belong together, motions that are too short.
    """
    Options(level)
    if rounds < 1:
        raise InputError(f"rounds is {rounds}: one at least")
    whole = RigidBody(urdf)
    given = [paths_of(one) for one in (bags, validate, payload)]
    if not given[0]:
        raise InputError("no bag: give the recordings of the robot")
    progress(0.0, "reading")
    read = read_joints([path for paths in given for path in paths], whole.joints, topic)
    ends = (len(given[0]), len(given[0]) + len(given[1]))
    records = [one for one in read if one.bag < ends[0]]
    unseen = [one for one in read if ends[0] <= one.bag < ends[1]]
    loaded = [one for one in read if one.bag >= ends[1]]
    robot = RigidBody(urdf, records[0].joints)
    count = _cores() if workers is None else workers
    found = identify(robot, records, unseen, level=level, rounds=rounds, workers=count, seed=seed, report=progress)
    body = None
    if loaded:
        progress(0.98, "payload")
        motions = robot_motions(loaded, [one == "prismatic" for one in robot.types])
        empty, full = (
            [one.without(found.effects(one.motion)) for one in balances]
            for balances in (found.balances, [balance_of(robot, one) for one in motions])
        )
        body = fit_payload(found.fit, empty, full)
    findings = tuple(dict.fromkeys(one.text for record in read for one in record.findings if one.level == "warning"))
    return RobotIdentification(found, body, findings)


def _cores() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1
