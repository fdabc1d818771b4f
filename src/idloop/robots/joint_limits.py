"""What the joints of a robot may do, by its URDF."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.robots.rigid_body import read_urdf
from idloop.spelling import did_you_mean


@dataclass(frozen=True)
class JointLimits:
    """What the joints of a robot may do."""

    joints: tuple[str, ...]
    # shape (joints,): [rad or m, and per s; N·m or N; rad/s² or m/s²]. Infinite where there is no limit.
    lower: Array
    upper: Array
    velocity: Array
    effort: Array
    acceleration: Array

    def breach(self, position: Iterable[float], velocity: Iterable[float], effort: Iterable[float]) -> str:
        """Return which joint exceeds which limit, empty when none does; what is not measured is NaN."""
        rows = zip(self.joints, position, velocity, effort, strict=True)
        for k, (joint, place, speed, force) in enumerate(rows):
            if place < self.lower[k] or place > self.upper[k]:
                return f"position {place:.4g} of {joint} is outside {self.lower[k]:.4g} .. {self.upper[k]:.4g}"
            if abs(speed) > self.velocity[k]:
                return f"velocity {speed:.4g} of {joint} is beyond {self.velocity[k]:.4g}"
            if abs(force) > self.effort[k]:
                return f"effort {force:.4g} of {joint} is beyond {self.effort[k]:.4g}"
        return ""


def urdf_limits(path: Path | str, joints: Sequence[str], acceleration: float) -> JointLimits:
    """Limits of position, velocity and effort that a URDF gives, with one of the acceleration for all joints.

    `acceleration`: [rad/s² or m/s²]. Raises InputError: the file cannot be read, lacks a joint, or has no velocity
    limit for it.
    """
    text = read_urdf(Path(path))
    try:
        known = {one.get("name", ""): one for one in ET.fromstring(text).iter("joint")}  # noqa: S314  (a local file)
    except ET.ParseError as error:
        raise InputError(f"{path}: is no URDF ({error})") from error
    rows = [_limits_of(path, joint, known) for joint in joints]
    lower, upper, velocity, effort = (np.array(column, dtype=float) for column in zip(*rows, strict=True))
    return JointLimits(tuple(joints), lower, upper, velocity, effort, np.full(len(rows), acceleration))


def _limits_of(path: Path | str, joint: str, known: Mapping[str, ET.Element]) -> tuple[float, float, float, float]:
    if joint not in known:
        raise InputError(f"{path}: no joint {joint!r}{did_you_mean(joint, known)}")
    limit = known[joint].find("limit")
    velocity = 0.0 if limit is None else _number(path, joint, limit, "velocity", 0.0)
    if limit is None or velocity <= 0.0:
        raise InputError(f"{path}: joint {joint}: no velocity limit; add <limit velocity=...> to it")
    free = known[joint].get("type") == "continuous"
    lower, upper = (
        (-math.inf, math.inf) if free else (_number(path, joint, limit, end, 0.0) for end in ("lower", "upper"))
    )
    if not lower < upper:
        raise InputError(f"{path}: joint {joint}: lower limit {lower:g} is not below upper limit {upper:g}")
    return lower, upper, velocity, _number(path, joint, limit, "effort", 0.0) or math.inf


def _number(path: Path | str, joint: str, limit: ET.Element, name: str, otherwise: float) -> float:
    text = limit.get(name)
    try:
        value = otherwise if text is None else float(text)
    except ValueError as error:
        raise InputError(f"{path}: joint {joint}: {name} {text!r} is no number") from error
    if not math.isfinite(value):
        raise InputError(f"{path}: joint {joint}: {name} {text} is not finite")
    return value
