"""The document of an identified robot: plain values, from which words, page and JSON are made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.diagnosis import Ladder
from idloop.physics.model import Model
from idloop.reporting.estimates import parameter_estimates
from idloop.reporting.verdicts import conclusion, undetectable
from idloop.robots.identify import Robot
from idloop.robots.joint_models import JointTask
from idloop.robots.rigid_fit import EFFECTS, Payload
from idloop.validation import compare
from idloop.validation.where import DRIVE_FORCE

SCHEMA = "idloop/robot/1"
# Condition number above which the least-squares fit is sensitive to noise and model error (Gautier and Khalil, Int. J.
# Robotics Research 11, 1992).
_BADLY_EXCITED = 100.0
_MOST_NAMED = 4


def document(robot: Robot, payload: Payload | None, findings: Sequence[str]) -> dict[str, Any]:
    """Return the document of schema ``idloop/robot/1``."""
    names = robot.rigid_body.joints
    errors = robot.errors
    joints = [
        {
            **_joint(ladder, task, model),
            "where": "" if place in robot.resting else _where(ladder, task),
            "moves": place not in robot.resting,
            "type": robot.rigid_body.types[place],
            "own_inertia": task.inertia,
            "errors": [
                {
                    "record": one.record,
                    "unseen": one.unseen,
                    "rms": float(one.rms[place]),
                    "relative": float(one.relative[place]),
                    "rigid_rms": float(one.rigid[place]),
                }
                for one in errors
            ],
        }
        for place, (ladder, task, model) in enumerate(zip(robot.ladders, robot.tasks, robot.models(), strict=True))
    ]
    return {
        "schema": SCHEMA,
        "urdf": str(robot.rigid_body.path),
        "level": robot.ladders[0].level * len(names),
        "findings": list(findings),
        "records": [{"name": one.record, "unseen": one.unseen} for one in errors],
        "joints": joints,
        "links": {name: _link(values) for name, values in zip(names, robot.fit.links, strict=True)},
        "base": [
            {**vars(one), "interval": list(one.interval)}
            for one in robot.fit.base
            if not one.name.endswith(f".{EFFECTS}")
        ],
        "condition": robot.fit.condition,
        "consistency": robot.fit.excess,
        "excite": _to_excite(robot),
        "payload": None if payload is None else {key: _plain(value) for key, value in vars(payload).items()},
    }  # fmt: skip


def _joint(ladder: Ladder, task: JointTask, model: Model) -> dict[str, Any]:
    return {
        "name": task.model.name,
        "unit": task.model.units.force,
        "verdict": ladder.verdict,
        "conclusion": conclusion(ladder),
        "added": [
            {"effect": step.added.name, "p_value": step.p_value, "text": step.added.text,
             "rivals": list(ladder.rivals(step)), "explains": step.added.explains}
            for step in ladder.steps
            if step.added is not None
        ],
        "steps": [
            {"name": "start" if step.added is None else step.added.name, "fitted": step.train.get("force"),
             "unseen": step.validation.get("force")}
            for step in ladder.steps
        ],
        "parameters": parameter_estimates(model),
        "chosen": {p.name: p.value for p in model.parameters if not p.free and p.name.startswith(ladder.added)},
        "model": model.to_yaml(),
        "not_shown": undetectable(ladder),
        "data": list(ladder.findings),
    }  # fmt: skip


def _where(ladder: Ladder, task: JointTask) -> str:
    """Where the torque error of a joint is largest; empty where it is spread evenly."""
    for one in compare(ladder.model, task.records[0]).where.maps:
        if one.name == DRIVE_FORCE:
            line = " ".join(one.lines()[1].split())
            variable, _, rest = line.partition(" ")
            return "" if variable in {"evenly", "worst:"} else f"by {variable}, {rest}"
    return ""


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


def _link(values: Array) -> dict[str, Any]:
    mass = float(values[0])
    return {"mass": mass, "centre": (values[1:4] / mass).tolist(), "inertia": values[4:].tolist()}


def _to_excite(robot: Robot) -> list[str]:
    """What a further record should contain, in words."""
    found = []
    for place, name in enumerate(robot.rigid_body.joints):
        position = np.concatenate([one.motion.position[:, place] for one in robot.balances])
        speed = np.concatenate([one.motion.velocity[:, place] for one in robot.balances])
        span = float(np.ptp(position))
        if place in robot.resting:
            found.append(f"{name} hardly moves: its friction, and the links behind it, need a motion of it")
        elif robot.rigid_body.types[place] != "prismatic" and span < 0.5 * np.pi:
            found.append(
                f"{name} moves over {np.degrees(span):.0f}°: waves over its angle, such as cogging, need a quarter of a"
                " turn or more"
            )
        elif np.min(speed) > 0.0 or np.max(speed) < 0.0:
            found.append(f"{name} moves one way only: friction cannot be told from a constant torque")
    if robot.fit.condition > _BADLY_EXCITED:
        weak = sorted(robot.fit.base, key=lambda one: -one.stderr / max(abs(one.value), 1e-300))
        found.append(
            f"the condition number of the base parameters is {robot.fit.condition:.3g}, above {_BADLY_EXCITED:g}, worst"
            f" for {', '.join(one.name for one in weak[:_MOST_NAMED])}: record an optimised trajectory"
        )
    return found
