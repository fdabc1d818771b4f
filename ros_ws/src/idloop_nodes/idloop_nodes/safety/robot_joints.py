"""The robot's side of a bridge: its joints, its units, its messages, its clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from idloop.errors import InputError
from idloop.spelling import did_you_mean
from idloop_nodes.codec import JointReader, JointWriter, encode_float, encode_floats
from idloop_nodes.codec.joints import FIELDS, NAN
from idloop_nodes.streams.stream_watch import JUMP_NS

# A stamp this much older than its arrival, and none in the future, may be of our own clock [ns].
PLAUSIBLE_NS = 50_000_000
# The least delay of one such stretch and of the one before counts, so that a drifting clock is followed [ns].
STRETCH_NS = 10_000_000_000


class RobotClock:
    """Converts local time into the time of the robot's stamps."""

    def __init__(self) -> None:
        self._least: int | None = None
        self._before: int | None = None
        self._until = 0
        self._newest = 0

    def update(self, stamp_ns: int, now_ns: int) -> None:
        """Take in the stamp of a measurement, 0 where it has none, and its arrival."""
        if not stamp_ns:
            return
        behind = now_ns - stamp_ns
        if self._least is None or abs(behind - self.behind) >= JUMP_NS:
            self._least, self._before, self._until, self._newest = behind, None, now_ns + STRETCH_NS, 0
        elif now_ns >= self._until:
            self._least, self._before, self._until = behind, self._least, now_ns + STRETCH_NS
        else:
            self._least = min(self._least, behind)

    @property
    def behind(self) -> int:
        """How far the robot's stamps lie behind their arrival at the least [ns]; 0 before the first."""
        known = [one for one in (self._least, self._before) if one is not None]
        return min(known, default=0)

    @property
    def is_ours(self) -> bool:
        """Whether the robot may stamp with our own clock."""
        return 0 <= self.behind <= PLAUSIBLE_NS

    def stamp(self, now_ns: int) -> int:
        """Return our time in the robot's clock, never back by the little that an estimate changes [ns]."""
        stamp = now_ns if self.is_ours else now_ns - self.behind
        if 0 <= self._newest - stamp < JUMP_NS:
            stamp = self._newest + 1
        self._newest = stamp
        return stamp


@dataclass(frozen=True)
class Conversion:
    """Ours = scale × the robot's + offset."""

    scale: float = 1.0
    offset: float = 0.0

    def to_ours(self, value: float) -> float:
        """Return a number of the robot in our unit."""
        return self.scale * value + self.offset

    def to_robot(self, value: float) -> float:
        """Return a number of ours in the robot's unit."""
        return (value - self.offset) / self.scale


class RobotJoints:
    """Reads the robot's measurements and writes its commands; InputError: parameters contradict one another."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.robot_names = tuple(values["robot_joints"])
        # Our names of the joints, the driven first
        self.names = tuple(values["joints"]) or self.robot_names
        # What the robot measures
        self.fields = tuple(field for field in FIELDS if field in values["fields"])
        self._interface: str = values["interface"]
        self._others = tuple(values["controller_joints"]) or self.robot_names[:1]
        _check(self, values)
        self._index = self._others.index(self.robot_names[0])
        self._units = _conversions(values)
        self._reader = JointReader([(joint, field) for joint in self.robot_names for field in FIELDS])
        self._rest_reader = JointReader([(joint, "position") for joint in self._others])
        self._rest = [NAN if self._interface == "position" else 0.0] * len(self._others)
        self._writer = JointWriter(self.names, FIELDS)
        self._encode = self._encoder(values["command_type"])

    def read(self, data: bytes) -> tuple[int, list[float]] | None:
        """Return stamp and position, velocity, effort of every joint in our units; None without the driven joint."""
        stamp, raw = self._reader.read(data)
        if self.robot_names[0] not in self._reader.names:
            return None
        if any(map(math.isnan, self._rest)):
            self._hold_others(self._rest_reader.read(data)[1])
        units = [self._units[field] for field in FIELDS]
        return stamp, [units[place % 3].to_ours(value) for place, value in enumerate(raw)]

    def measured(self, values: Sequence[float], field: str) -> float | None:
        """Return a field of the driven joint, None where the robot does not measure it."""
        return values[FIELDS.index(field)] if field in self.fields else None

    def pack(self, stamp_ns: int, values: Sequence[float]) -> bytes:
        """Return the measurement as our message."""
        blank = [NAN] * len(self.names)
        columns = [values[place::3] if field in self.fields else blank for place, field in enumerate(FIELDS)]
        return self._writer.pack(stamp_ns, *columns)

    def command(self, stamp_ns: int, value: float) -> bytes | None:
        """Return a command in the robot's unit as its message; None where the place of another joint is not known."""
        row = list(self._rest)
        row[self._index] = self._units["command"].to_robot(value)
        return self._encode(stamp_ns, row) if all(map(math.isfinite, row)) else None

    @property
    def seen(self) -> tuple[str, ...]:
        """Joints of the newest message."""
        return self._reader.names

    def _hold_others(self, positions: Sequence[float]) -> None:
        """Remember where the other joints of a position controller are: they are commanded to stay there."""
        known = zip(self._rest, positions, strict=True)
        self._rest = [position if math.isnan(rest) else rest for rest, position in known]

    def _encoder(self, command_type: str) -> Callable[[int, list[float]], bytes]:
        if command_type == "float64":
            return lambda stamp, row: encode_float(row[self._index])
        if command_type == "joint_state":
            return JointWriter(self._others, [self._interface]).pack
        return lambda stamp, row: encode_floats(row)


def _check(robot: RobotJoints, values: Mapping[str, Any]) -> None:
    """Refuse what no robot can mean."""
    unknown = [field for field in values["fields"] if field not in FIELDS]
    if unknown:
        raise InputError(f"bridge: fields: no field {unknown[0]!r}{did_you_mean(unknown[0], FIELDS)}")
    if not robot.robot_names or len(set(robot.robot_names)) != len(robot.robot_names):
        raise InputError("bridge: robot_joints: name each joint once, the driven one first")
    if len(robot.names) != len(robot.robot_names):
        raise InputError(f"bridge: joints: {len(robot.names)} names for {len(robot.robot_names)} robot_joints")
    controller = tuple(values["controller_joints"])
    if controller and robot.robot_names[0] not in controller:
        raise InputError(
            f"bridge: controller_joints: {robot.robot_names[0]} is not among them ({', '.join(controller)}); "
            "name all joints of the controller in its order"
        )
    if len(controller) > 1 and values["command_type"] == "float64":
        raise InputError("bridge: controller_joints: a float64 message has room for one joint")
    if values["interface"] == "position" and "position" not in robot.fields:
        raise InputError("bridge: fields: a position can be commanded only where it is measured; add position")


def _conversions(values: Mapping[str, Any]) -> dict[str, Conversion]:
    """Return the conversion of every field and of the command."""

    def chosen(name: str, otherwise: float) -> float:
        return otherwise if values[name] is None else float(values[name])

    position = Conversion(values["scale.position"], values["offset.position"])
    units = {
        "position": position,
        "velocity": Conversion(chosen("scale.velocity", position.scale)),
        "effort": Conversion(values["scale.effort"], values["offset.effort"]),
    }
    same = units[values["interface"]]
    units["command"] = Conversion(chosen("scale.command", same.scale), chosen("offset.command", same.offset))
    return units
