"""Position, velocity and effort of every joint of a robot on one time axis, from a JointState bag."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.physics.model import Model
from idloop.physics.model_file import from_text
from idloop.records.bags.bag import Bag
from idloop.records.bags.clock_runs import split_runs
from idloop.records.bags.read import read_streams
from idloop.records.bags.storage.storage_files import bag_name
from idloop.records.bags.stream import JOINT_STATE, JointStream
from idloop.records.bags.topics import resolve_topic
from idloop.records.finding import Finding
from idloop.records.inspection.velocity_check import without_wrong_velocities
from idloop.records.record import Record
from idloop.spelling import listed

# A joint that is missing for more steps than this is not interpolated: the record is cut there.
_LONGEST_PAUSE = 5.0
# Shortest part between two pauses that is used [samples].
_SHORTEST = 200

_AXIS = """
schema: idloop/model/1
name: {joint}
input: {{topic: joint_states, joint: {joint}, field: effort, unit: {force}, kind: measured}}
outputs:
  - {{topic: joint_states, joint: {joint}, field: position, unit: {place}}}
  - {{topic: joint_states, joint: {joint}, field: velocity, unit: {place}/s}}
bodies:
  - {{name: {joint}, inertia: {{value: {inertia}, min: 0.0}}, viscous_friction: {{value: {viscous}, min: 0.0}}}}
drive: {{gain: 1.0}}
effects:
  - {{effect: coulomb_friction, at: {joint}, level: {{value: {dry}, min: 0.0}}}}
  - {{effect: load_torque, at: {joint}, torque: {{value: {constant}}}}}
"""


def axis_model(
    joint: str, *, prismatic: bool, inertia: float = 1.0, viscous: float = 0.0, dry: float = 0.0, constant: float = 0.0
) -> Model:
    """Build the one-body model of a joint: inertia, viscous and Coulomb friction, and a constant torque, all free.

    Its input is the measured effort.
    """
    force, place = ("N", "m") if prismatic else ("N·m", "rad")
    numbers = {"inertia": inertia, "viscous": viscous, "dry": dry, "constant": constant}
    text = _AXIS.format(joint=joint, force=force, place=place, **{key: float(value) for key, value in numbers.items()})
    return from_text(text, None)


@dataclass(frozen=True, eq=False)
class JointRecord:
    """Joints of a robot on a uniform time axis."""

    name: str
    joints: tuple[str, ...]
    time: Array  # shape (n,): [s]
    # shape (n, joints): [rad or m, rad/s or m/s, N·m or N]; a velocity is NaN throughout where there is none to be used
    position: Array
    velocity: Array
    effort: Array
    bag: int = 0  # place of its bag among those that were read together
    findings: tuple[Finding, ...] = ()

    @property
    def sample_time(self) -> float:
        """Step of the time axis [s]."""
        return float(self.time[1] - self.time[0])

    def axis(self, place: int, model: Model, effort: Array | None = None) -> Record:
        """Record of one joint.

        `place`: of the joint. `model`: from `axis_model`. `effort` (n,): in place of the measured one.
        """
        given = self.effort[:, place] if effort is None else effort
        measured = {"position": self.position[:, place], "velocity": self.velocity[:, place]}
        return Record.from_arrays(self.time, given, measured, model, name=self.name)


def read_joints(bags: Iterable[str | Path], joints: Sequence[str], topic: str = "joint_states") -> list[JointRecord]:
    """Read the joints of a robot from bags, in the order given, whatever their order in the messages.

    Joints that not every bag has are left out of all. A joint that is missing in some messages is interpolated; where
    it is missing for more than five steps, the record is cut.

    `bags`: rosbag2 folders, ``.mcap`` or ``.db3`` files. `joints`: of the robot. Raises InputError: no such bag or
    topic, none of the joints in it, no effort, or nothing long enough without a gap.
    """
    paths = [Path(bag) for bag in bags]
    twice = next((path for place, path in enumerate(paths) if path in paths[:place]), None)
    if twice is not None:
        raise InputError(f"{twice} is given twice: one recording counts once; leave it out, or give another")
    streams = [(place, stream) for place, path in enumerate(paths) for stream in _runs(path, topic)]
    common = [name for name in joints if all(name in stream.names for _, stream in streams)]
    if not common:
        found = listed(list(dict.fromkeys(name for _, stream in streams for name in stream.names)))
        raise InputError(f"{paths[0]}: none of the robot's joints is in it: it has {found}, the robot {listed(joints)}")
    records = [
        replace(record, bag=place)
        for place, stream in streams
        for record in _on_grid(paths[place], stream, tuple(common))
    ]
    checked = _with_usable_velocities(records)
    others = [name for name in joints if name not in common]
    if others:
        text = f"joints that were not recorded are taken as fixed at 0: {listed(others)}"
        fixed = Finding("fixed_joints", text, level="warning")
        checked[0] = replace(checked[0], findings=(*checked[0].findings, fixed))
    return checked


def _runs(path: Path, topic: str) -> list[JointStream]:
    if not path.exists():
        raise InputError(f"no bag {path}: check the path (recordings go to bags/ by default)")
    with Bag(path) as bag:
        name = resolve_topic(topic, bag.topics, path)
        if bag.topics[name].type != JOINT_STATE:
            raise InputError(f"{path}: {name} is {bag.topics[name].type}; give the topic of the {JOINT_STATE}")
        stream = read_streams(bag, [name])[name]
    return split_runs(stream)


def _on_grid(path: Path, stream: JointStream, joints: tuple[str, ...]) -> list[JointRecord]:
    """Parts of a stream without a pause of any joint, on a common uniform grid."""
    places = [stream.names.index(name) for name in joints]
    stamp, first = np.unique(stream.stamp_ns, return_index=True)
    time = (stamp - stamp[0]) / 1e9
    position, velocity, effort = (
        getattr(stream, field)[first][:, places] for field in ("position", "velocity", "effort")
    )
    for field, values in (("position", position), ("effort", effort)):
        absent = [name for name, column in zip(joints, values.T, strict=True) if not np.isfinite(column).any()]
        if absent:
            raise InputError(
                f"{path}: {stream.topic} holds no {field} of {listed(absent)}; a robot is identified from position and"
                " measured effort of every joint"
            )
    known = np.isfinite(position) & np.isfinite(effort)
    step = float(np.median([np.median(np.diff(time[column])) for column in known.T if column.sum() > 1]))
    grid = np.arange(time[0], time[-1] + 1e-6 * step, step)
    usable = np.ones(len(grid), dtype=bool)
    columns: dict[str, list[Array]] = {"position": [], "velocity": [], "effort": []}
    for place in range(len(joints)):
        own = time[known[:, place]]
        usable &= (grid >= own[0] - 1e-6 * step) & (grid <= own[-1] + 1e-6 * step)
        for pause in np.flatnonzero(np.diff(own) > _LONGEST_PAUSE * step):
            usable &= ~((grid > own[pause] + 1e-6 * step) & (grid < own[pause + 1] - 1e-6 * step))
        for field, values in (("position", position), ("velocity", velocity), ("effort", effort)):
            there = np.isfinite(values[:, place])
            enough = there.sum() > 0.95 * known[:, place].sum()
            columns[field].append(
                np.interp(grid, time[there], values[there, place]) if enough else np.full(len(grid), np.nan)
            )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], usable, [False]]).astype(int)))
    parts = [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= _SHORTEST]
    if not parts:
        raise InputError(f"{path}: no {_SHORTEST} samples in which every joint was measured; record for longer")
    name = bag_name(path)
    findings = list(stream.findings)
    if len(parts) > 1 or parts[0].stop - parts[0].start < len(grid) - 2 * _SHORTEST:
        text = f"{path}: a joint was missing for more than {_LONGEST_PAUSE:g} steps: {len(parts)} parts are used"
        findings.append(Finding("gap", text, len(parts) - 1, name, "warning"))
    table: dict[str, Any] = {field: np.column_stack(values) for field, values in columns.items()}
    return [
        JointRecord(
            name if number == 0 else f"{name}({number + 1})",
            joints,
            grid[part] - grid[part.start],
            **{field: values[part] for field, values in table.items()},
            findings=tuple(findings) if number == 0 else (),
        )
        for number, part in enumerate(parts)
    ]


def _with_usable_velocities(records: Sequence[JointRecord]) -> list[JointRecord]:
    """Blank the velocities that are not the derivatives of their positions."""
    found = [replace(record, velocity=record.velocity.copy()) for record in records]
    for place, joint in enumerate(records[0].joints):
        if not all(np.isfinite(record.velocity[:, place]).any() for record in records):
            for record in found:
                record.velocity[:, place] = np.nan
            continue
        model = axis_model(joint, prismatic=False)
        axes = without_wrong_velocities([record.axis(place, model) for record in records])
        for number, one in enumerate(axes):
            found[number].velocity[:, place] = one.output[:, 1]
            found[number] = replace(found[number], findings=(*found[number].findings, *one.findings))
    return found
