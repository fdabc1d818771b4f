"""The trajectory that shows most of a robot's parameters, within its limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.api.result import Progress, Result, ignore_progress
from idloop.api.single_thread import single_threaded
from idloop.errors import InputError
from idloop.output_files import write_text
from idloop.reporting.text.blocks import Block, Table, number
from idloop.robots.excitation import limits_of, plan, trajectory_text
from idloop.robots.rigid_body import RigidBody

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.robots.excitation import Limits, Trajectory

FORMS = {".csv": "csv", ".yaml": "yaml", ".yml": "yaml"}


@dataclass(frozen=True)
class RobotExcitation(Result):
    """A planned trajectory.

    Attributes
    ----------
    trajectory : idloop.robots.excitation.Trajectory
        Joints, time, position, velocity, acceleration, condition number.
    limits : idloop.robots.excitation.Limits
    """

    trajectory: Trajectory
    limits: Limits

    def blocks(self) -> Iterator[Block]:
        """Yield the table of joints and what the trajectory is worth."""
        found, limits = self.trajectory, self.limits
        rows = []
        for place, joint in enumerate(found.joints):
            q, v, a = (one[:, place] for one in (found.position, found.velocity, found.acceleration))
            sizes = (q.min(), q.max(), limits.lower[place], limits.upper[place])
            least, most, lower, upper = (number(float(one), 3) for one in sizes)
            fastest = (np.max(np.abs(v)), limits.velocity[place], np.max(np.abs(a)))
            rows.append((joint, least, most, f"{lower} .. {upper}", *(number(float(one), 3) for one in fastest)))
        yield Table.of(("joint", "from", "to", "within", "speed", "limit", "acceleration"), rows)
        yield (
            f"{found.time[-1]:g} s, {len(found.time)} points; condition number of the base parameters"
            f" {found.condition:.3g}, of the best random trajectory {found.before:.3g}"
        )
        if np.isfinite(found.distance):
            yield f"least distance between links {found.distance:.3g} m"
        yield from (f"note: {text}" for text in found.notes)

    def plot(self) -> Figure:
        """Draw position and velocity of every joint."""
        found = self.trajectory
        with drawing.styled():
            figure, axes = drawing.new_figure(2)
            curves = ((axes[0, 0], found.position, "position"), (axes[1, 0], found.velocity, "speed"))
            for axis, values, label in curves:
                for place, joint in enumerate(found.joints):
                    drawing.line(axis, found.time, values[:, place], label=joint)
                axis.set_ylabel(label)
            axes[0, 0].legend(ncols=3, fontsize="small")
            axes[1, 0].set_xlabel("time [s]")
        return figure

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/robot-excitation/1``."""
        found = self.trajectory
        return {
            "schema": "idloop/robot-excitation/1",
            "joints": list(found.joints),
            **{key: getattr(found, key).tolist() for key in ("time", "position", "velocity", "acceleration")},
            "condition": found.condition,
            "condition_of_best_random": found.before,
            "distance": found.distance if np.isfinite(found.distance) else None,
            "notes": list(found.notes),
        }

    def save(self, path: str | Path) -> Path:
        """Write the points as ``.yaml`` (trajectory_msgs/msg/JointTrajectory) or ``.csv``.

        Raises
        ------
        InputError
            Another suffix.
        """
        target = Path(path)
        if target.suffix.lower() not in FORMS:
            raise InputError(f"{target}: the suffix must be one of {', '.join(FORMS)}")
        write_text(target, trajectory_text(self.trajectory, FORMS[target.suffix.lower()]))
        return target


@single_threaded
def excite_robot(
    urdf: str | Path,
    *,
    period: float = 10.0,
    periods: int = 2,
    harmonics: int = 5,
    share: float = 0.8,
    max_acceleration: float | None = None,
    distance: float = 0.03,
    rate: float = 50.0,
    starts: int = 20,
    steps: int = 20,
    seed: int = 0,
    progress: Progress = ignore_progress,
) -> RobotExcitation:
    """Plan a periodic trajectory of all joints that shows most of a robot's parameters, within its limits.

    Parameters
    ----------
    urdf : str or Path
        Description with limits of position, velocity and effort, inertias and collision geometry.
    period : float
        [s]
    periods : int
        How often it is repeated.
    harmonics : int
        Sines of each joint, two at least.
    share : float
        Part of every limit that is used.
    max_acceleration : float, optional
        Of every joint [rad/s² or m/s²].
    distance : float
        Least distance between links that are no neighbours [m].
    rate : float
        Points per second.
    starts : int
        Random trajectories, of which the best is optimised.
    steps : int
        Of the optimiser.
    seed : int
        Equal seeds give equal answers.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Raises
    ------
    InputError
        Pinocchio is not installed, a file that is no URDF, limits that leave no trajectory.
    """
    if not (period > 0.0 and periods >= 1 and harmonics >= 2 and rate > 0.0):
        raise InputError("period and rate must be above 0, periods 1 at least, harmonics 2 at least")
    robot = RigidBody(urdf)
    limits = limits_of(robot, share, max_acceleration, distance)
    found = plan(
        robot, limits, period=period, periods=periods, harmonics=harmonics, rate=rate, starts=starts, steps=steps,
        seed=seed, report=progress,
    )  # fmt: skip
    return RobotExcitation(found, limits)
